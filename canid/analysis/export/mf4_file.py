"""ASAM MF4 by asammdf, in a child process (see `mf4_child`): a channel group for each table."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import BinaryIO

from canid.analysis.export.mf4_child import NO_ASAMMDF, WRITTEN
from canid.analysis.export.table import Origin, Table
from canid.values.errors import ConfigError
from canid.values.processes.child import EXIT_S, Child, NoAnswerError
from canid.values.processes.child_process import command
from canid.values.terminal_text import terminal_text

# who wrote the file, in the identification block: 8 bytes from byte 16 on (ASAM MDF 4.1, IDBLOCK)
PROGRAM, PROGRAM_AT = b"canid   ", 16


class Mf4Writer:
    """The child, started early: asammdf takes most of a second to import."""

    def __init__(self, path: str) -> None:
        """Start it; `path`: a file that exists."""
        self._child = Child(command("canid.analysis.export.mf4_child", path, options=("-W", "ignore")))

    def write(self, tables: Sequence[Table], origin: Origin, file: BinaryIO) -> None:
        """Write all tables; each column with its unit and comment, the UTC start in the header.

        `file`: the same file, opened for writing.

        Raises:
            ConfigError: asammdf is missing.
            OSError: the file cannot be written.
        """
        comment = f"{origin.program} export of {terminal_text(origin.log)}"
        if origin.vehicle:
            comment += f", vehicle {terminal_text(origin.vehicle)}"
        # BrokenPipeError: the child has ended, and may have said why
        with suppress(BrokenPipeError):
            self._child.write((origin.start_ns, comment))
            for table in tables:
                columns = [
                    (
                        terminal_text(field.name),
                        terminal_text(field.unit),
                        terminal_text(field.comment),
                        values,
                    )
                    for field, values in zip(table.fields, table.values(slice(None)), strict=True)
                ]
                about = (terminal_text(table.title), terminal_text(table.comment))
                self._child.write((*about, table.t, columns))
            self._child.write(None)
        try:
            why = self._child.receive()
        except NoAnswerError:
            why = f"asammdf ended with code {self._child.end(EXIT_S)}"
        if why == NO_ASAMMDF:
            raise ConfigError("MF4 needs asammdf: pip install 'canid[mf4]'")
        if why != WRITTEN:
            raise OSError(0, why)
        file.seek(PROGRAM_AT)
        file.write(PROGRAM)

    def close(self) -> None:
        """End the child."""
        self._child.end()
