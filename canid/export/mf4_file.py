"""ASAM MF4 by asammdf, in a child process (see `mf4_child`): a channel group for each table."""

from __future__ import annotations

import pickle
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from typing import BinaryIO

from canid.child_process import command
from canid.errors import ConfigError
from canid.export.table import Origin, Table
from canid.views.terminal_text import terminal_text

# who wrote the file, in the identification block: 8 bytes from byte 16 on (ASAM MDF 4.1, IDBLOCK)
PROGRAM, PROGRAM_AT = b"canid   ", 16


class Mf4Writer:
    """The child, started early: asammdf takes most of a second to import."""

    def __init__(self, path: str) -> None:
        """Start it; `path`: a file that exists."""
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  (`close` closes it)
        self._child = subprocess.Popen(
            command("canid.export.mf4_child", path, options=("-W", "ignore")),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._errors,
        )

    def write(self, tables: Sequence[Table], origin: Origin, file: BinaryIO) -> None:
        """Write all tables; each column with its unit and comment, the UTC start in the header.

        `file`: the same file, opened for writing.

        Raises:
            ConfigError: asammdf is missing.
            OSError: the file cannot be written.
        """
        pipe = self._child.stdin
        assert pipe is not None
        try:
            comment = f"{origin.program} export of {terminal_text(origin.log)}"
            if origin.vehicle:
                comment += f", vehicle {terminal_text(origin.vehicle)}"
            pickle.dump((origin.start_ns, comment), pipe, protocol=5)
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
                pickle.dump((*about, table.t, columns), pipe, protocol=5)
            pickle.dump(None, pipe, protocol=5)
            pipe.close()
        except BrokenPipeError:
            pass  # the child has ended: its code says why
        code = self._child.wait()
        if code == 3:
            raise ConfigError("MF4 needs asammdf: pip install 'canid[mf4]'")
        if code:
            self._errors.seek(0)
            last = self._errors.read().decode(errors="replace").strip().rpartition("\n")[2]
            raise OSError(0, last or f"asammdf ended with code {code}")
        file.seek(PROGRAM_AT)
        file.write(PROGRAM)

    def close(self) -> None:
        """End the child."""
        self._child.kill()
        if self._child.stdin is not None:
            with suppress(OSError):
                self._child.stdin.close()
        self._child.wait()
        self._errors.close()
