"""What a user can do about a table that leaves something open, in the words of the command line or of Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from canid.analysis.tables.headings import heading


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
# files of public sets without a vehicle ahead: names, as `Heading.name`, that it has, and lacks; what it is
_RECORDING = "it describes a recording, whose rows are in the XX_tracks.csv of the same number"
_SUMO = "SUMO writes the vehicle ahead with --fcd-output.max-leader-distance 200 --fcd-output.acceleration"
_LAYOUTS = (
    ("initial_frame num_frames", "", _RECORDING),
    ("frame_rate location_id", "", _RECORDING),
    (
        "track_id x_center lon_velocity",
        "lead_id",
        "inD, rounD and uniD name no vehicle ahead; highD and exiD do",
    ),
    ("id pos angle", "leader_gap", _SUMO),
    ("vehicle_id vehicle_pos vehicle_angle", "vehicle_leader_gap", _SUMO),
)


def remedy_of(headings: Sequence[str]) -> str:
    """What a file of a known set is that has no vehicle ahead; "": it is none.

    Example:
        >>> remedy_of(["timestep_time", "vehicle_id", "vehicle_pos", "vehicle_angle"])[:35]
        'SUMO writes the vehicle ahead with '
        >>> remedy_of(["time", "speed", "gap"])
        ''
    """
    names = {heading(text).name for text in headings}
    return next(
        (says for has, lacks, says in _LAYOUTS if names >= {*has.split()} and not names & {*lacks.split()}),
        "",
    )
