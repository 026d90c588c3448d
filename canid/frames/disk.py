"""The file under a writer: created without overwriting, written at once, failing in one line."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import BinaryIO

from canid.errors import OutputError

# macOS and Windows have no fdatasync.
_to_disk = getattr(os, "fdatasync", os.fsync)


class TakenError(OutputError):
    """A file of that name is there already."""


class Disk:
    """A new file. `size` bytes of it are whole; a write that fails leaves `size` as it was."""

    def __init__(self, path: Path, *, overwrite: bool):
        self.path = path
        self.size = 0
        try:
            # unbuffered: every write reaches the kernel, so a kill loses nothing that was written
            self._file: BinaryIO = open(path, "wb" if overwrite else "xb", buffering=0)  # noqa: SIM115
        except FileExistsError:
            message = f"{path} exists already: choose another name, or overwrite it explicitly"
            raise TakenError(message) from None
        except OSError as error:
            raise OutputError(f"cannot create {path}: {error.strerror}") from None

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    def append(self, data: bytes) -> None:
        """Write at the end."""
        self.put(self.size, data)
        self.size += len(data)

    def put(self, at: int, data: bytes) -> None:
        """Write at byte `at`; raises OutputError."""
        try:
            self._file.seek(at)
            done = 0
            while done < len(data):  # a nearly full disk takes a part
                done += self._file.write(data[done:])
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {error.strerror}") from None

    def sync(self) -> None:
        """Have it all on the disk itself; raises OutputError."""
        try:
            _to_disk(self._file.fileno())
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {error.strerror}") from None

    def close(self) -> None:
        """Close, and cut off what a failed write left behind the last whole byte."""
        if self._file.closed:
            return
        # what a full disk took in part would read as damage; where even this fails, so be it
        with contextlib.suppress(OSError):
            if os.fstat(self._file.fileno()).st_size > self.size:
                os.ftruncate(self._file.fileno(), self.size)
        self._file.close()
