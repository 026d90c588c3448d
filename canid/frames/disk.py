"""A new file on the disk: never over another one, never empty where it has a beginning, failing in one line."""

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

    def __init__(self, path: Path, *, overwrite: bool, head: bytes = b""):
        """Create it. With a `head` the name appears only once the head is on the disk: no cut leaves it empty."""
        self.path = path
        self.size = 0
        self._entry_synced = False
        try:
            self._file: BinaryIO = _open(path, overwrite=overwrite, head=head)
        except FileExistsError:
            message = f"{path} exists already: choose another name, or overwrite it explicitly"
            raise TakenError(message) from None
        except OSError as error:
            raise OutputError(f"cannot create {path}: {error.strerror}") from None
        self.size = len(head)

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
            _write(self._file, data)
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {error.strerror}") from None

    def sync(self) -> None:
        """Have it all on the disk itself, its name in the folder too; raises OutputError."""
        try:
            _to_disk(self._file.fileno())
            if not self._entry_synced:
                _sync_folder(self.path.parent)
                self._entry_synced = True
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
        # some file systems tell of a failed write here and nowhere else; the last sync has been told already
        with contextlib.suppress(OSError):
            self._file.close()


def _open(path: Path, *, overwrite: bool, head: bytes) -> BinaryIO:
    """Open a new file that begins with `head`; unbuffered, so that a kill loses nothing that was written."""
    if head and not overwrite:
        linked = _open_linked(path, head)
        if linked is not None:
            return linked
    file: BinaryIO = open(path, "wb" if overwrite else "xb", buffering=0)  # noqa: SIM115
    try:
        _write(file, head)
    except OSError:
        file.close()
        raise
    return file


def _open_linked(path: Path, head: bytes) -> BinaryIO | None:
    """Write the head under another name first, then link it: the name never stands for an empty file.

    None where the file system has no hard links (FAT, some FUSE).
    """
    if path.exists():
        raise FileExistsError
    other = path.with_name(f".{path.name}.{os.getpid()}.new")
    file: BinaryIO = open(other, "wb", buffering=0)  # noqa: SIM115
    try:
        _write(file, head)
        _to_disk(file.fileno())
        os.link(other, path)
    except FileExistsError:
        file.close()
        raise
    except OSError as error:
        file.close()
        # full, or a write error: the plain way would fail as well, and leave an empty file behind
        if error.filename is None:
            raise
        return None
    finally:
        with contextlib.suppress(OSError):
            os.unlink(other)
    return file


def _write(file: BinaryIO, data: bytes) -> None:
    done = 0
    while done < len(data):  # a nearly full disk takes a part
        done += file.write(data[done:])


def _sync_folder(folder: Path) -> None:
    """Have the folder's entries on the disk: a file whose name is lost is lost."""
    # Windows cannot open folders, and some network file systems cannot sync them
    with contextlib.suppress(OSError):
        fd = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)
