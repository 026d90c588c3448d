"""What a user can do about a table that leaves something open, in the words of the command line or of Python."""

from __future__ import annotations

from typing import NamedTuple


class Remedies(NamedTuple):
    """Halves of sentences, for messages."""

    columns: str  # how columns are named, in general
    rows: str  # how some of the rows are selected
    vehicle: str  # how one of several vehicles is chosen
    map: str  # how one column is named; {role} and {column} are filled in
    counted: str  # what a table of numbered rows can do, behind the name of its column of times; "": nothing
    everyone: str  # how all vehicles are taken, behind the list of them; "": they cannot be

    def column(self, role: str, column: str = "NAME") -> str:
        """How the column of a role is named.

        Example:
            >>> FRAME.column("time", "t2")
            'columns={"time": "t2"}'
        """
        return self.map.replace("{role}", role).replace("{column}", column)


COMMAND_LINE = Remedies(
    "Name columns so, or in --columns MAP.toml",
    "select rows with --where",
    "choose one with --vehicle-id ID",
    '--columns MAP.toml with [columns] {role} = "{column}"',
    ' (time = { column = "row", rate = 10 } counts rows)',
    "; or all of them, each an episode of its own, with --vehicle-id all",
)
FRAME = Remedies(
    'Name columns so, or by columns={"gap": "NAME", ...}',
    "select its rows before the call",
    "select the rows of one before the call",
    'columns={"{role}": "{column}"}',
    "",
    "",
)
ARRAYS = FRAME._replace(columns="Give them as arguments of these names", map="{role}=...")
