"""A new file on the disk: never over another one, never empty where it has a header, with errors of one line."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

from canid.io.files import file_location
from canid.io.files.file_location import Place, Whereabouts
from canid.io.files.held_folder import HeldFolder
from canid.values.errors import OutputError

# macOS and Windows have no fdatasync.
_to_disk = getattr(os, "fdatasync", os.fsync)
# bytes copied at once
_COPY_SIZE = 1 << 20


class TakenError(OutputError):
    """A file of that name exists already."""


class ChangedError(OutputError):
    """Another program has truncated the file, or written into it."""


class Disk:
    """A new file. `size` bytes of it are whole; a write that fails leaves `size` as it was."""

    def __init__(self, path: Path, *, head: bytes = b"", folder: HeldFolder | None = None):
        """Create it. With a `head` the name appears only once the head is on the disk: no cut leaves it empty.

        `folder`: in which the last component of `path` is created, wherever its path leads; None: what it leads to now.
        Raises OutputError, TakenError.
        """
        self.path = path
        self.size = 0
        self.taken = 0  # bytes of an `append` that failed which are in the file, until `keep`
        self.changed = ""  # the error where another program wrote into it; then nothing more is written
        self.broken = False  # a write or a sync has failed: it ends where it is whole
        self.closing: Callable[[Disk], object] | None = None  # called before the descriptor is closed
        self._entry_synced = False
        self._fd = -1
        try:
            self.folder = folder or HeldFolder(path.parent)
            self._fd = _open(self.folder, path.name, head=head)
        except FileExistsError:
            message = f"{path} exists already: choose another name"
            raise TakenError(message) from None
        except OSError as error:
            raise OutputError(f"cannot create {path}: {error.strerror}", error.errno) from None
        self.size = len(head)
        # Some network file systems have no lasting inode numbers: there only a failing write shows that a file is gone. A
        # device (/dev/null) has no size.
        self._findable = self.folder.names(path.name, os.fstat(self._fd))
        self._sized = self.size_on_disk() == self.size
        self._proved = False  # that the size follows what is written, as some network file systems' does not

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._fd < 0

    def fileno(self) -> int:
        """Return the descriptor; raises ValueError where it is closed."""
        if self._fd < 0:
            raise ValueError("the file is closed")
        return self._fd

    def append(self, data: bytes) -> None:
        """Write at the end."""
        self._check_size()
        self.taken = 0
        try:
            self._write(self.size, data)
        except OutputError:
            self.taken = max(min(self.size_on_disk() - self.size, len(data)), 0)
            raise
        self.size += len(data)
        if not self._proved:
            self._proved = True
            self._sized = self._sized and self.size_on_disk() == self.size

    def keep(self, count: int) -> None:
        """After an `append` that failed: its first `count` bytes count as written, what follows them is cut off."""
        self.size += count
        self.taken = 0
        self._cut()

    def put(self, at: int, data: bytes) -> None:
        """Write at byte `at`, over what was written before; raises OutputError."""
        self._check_size()
        self._write(at, data)

    def sync(self) -> None:
        """Sync all of it to the disk itself, its name in the folder too; raises OutputError."""
        try:
            _to_disk(self.fileno())
            if not self._entry_synced:
                self.folder.sync()
                self._entry_synced = True
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {error.strerror}", error.errno) from None

    def find(self) -> Whereabouts:
        """Where the file is now."""
        if not self._findable or self.closed:
            return Whereabouts(Place.HERE, self.path)
        return file_location.find(self.fileno(), self.path, self.folder)

    def moved(self, path: Path) -> None:
        """Note the file's new name, in a folder that may be another one."""
        with contextlib.suppress(OSError, ValueError):
            if not self.folder.names(path.name, os.fstat(self.fileno())):
                self.folder = HeldFolder(path.parent)
        self.path = path
        self._entry_synced = False

    def read(self, at: int, count: int) -> bytes:
        """Read back what was written, whether or not the file still has a name. Raises OSError."""
        return _read(self.fileno(), at, count)

    def copy(self, name: str, folder: HeldFolder) -> Disk:
        """Copy what was written into a new file of a folder, on the disk. Raises OutputError, TakenError."""
        copied = Disk(folder.path / name, folder=folder)
        try:
            while copied.size < self.size:
                chunk = self.read(copied.size, min(_COPY_SIZE, self.size - copied.size))
                if not chunk:
                    raise OutputError(f"{self.path} cannot be read back beyond byte {copied.size}")
                copied.append(chunk)
            copied.sync()
        except (OSError, OutputError) as error:
            copied.close()
            raise OutputError(str(error)) from None
        return copied

    def remove(self) -> None:
        """Close it and delete its name, where that still leads to it: of a file that holds nothing."""
        with contextlib.suppress(OSError, ValueError):
            if self.folder.names(self.path.name, os.fstat(self.fileno())):
                self.folder.unlink(self.path.name)
        self.close()

    def size_on_disk(self) -> int:
        """Bytes that the file has now; `size` where that is unknown."""
        try:
            return os.fstat(self.fileno()).st_size
        except OSError:
            return self.size

    def close(self) -> None:
        """Close, and cut off what a failed write left after the last whole byte."""
        if self.closed:
            return
        self._cut()
        if self.closing is not None:
            self.closing(self)
        fd, self._fd = self._fd, -1
        # some file systems report a failed write here and nowhere else; the last sync was reported already
        with contextlib.suppress(OSError):
            os.close(fd)

    def _cut(self) -> None:
        # what a full disk took in part would read as damage; where even this fails, it stays
        with contextlib.suppress(OSError):
            if self._sized and self.size_on_disk() > self.size:
                os.ftruncate(self.fileno(), self.size)

    def _check_size(self) -> None:
        """Raise ChangedError where another program has changed the size: writing on would leave a hole."""
        if self._sized and (size := self.size_on_disk()) != self.size:
            self._sized = False  # nothing is cut off any more: another program writes it
            self.changed = f"{self.path} was changed by another program: it has {size:,} bytes, {self.size:,} were written"
        if self.changed:
            raise ChangedError(self.changed)

    def _write(self, at: int, data: bytes) -> None:
        try:
            _write(self.fileno(), at, data)
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {error.strerror}", error.errno) from None


def _open(folder: HeldFolder, name: str, *, head: bytes) -> int:
    """Open a new file that begins with `head`; unbuffered, so that a kill loses nothing that was written."""
    if head:
        linked = _open_linked(folder, name, head)
        if linked >= 0:
            return linked
    fd = folder.create(name)
    try:
        _write(fd, 0, head)
    except OSError:
        os.close(fd)
        raise
    return fd


def _open_linked(folder: HeldFolder, name: str, head: bytes) -> int:
    """Write the head under another name first, then link it: the name never stands for an empty file.

    -1 where the file system has no hard links (FAT, some FUSE).
    """
    if folder.has(name):
        raise FileExistsError
    fd, other = folder.create_temporary(name)
    try:
        _write(fd, 0, head)
        _to_disk(fd)
        folder.link(other, name)
    except FileExistsError:
        os.close(fd)
        raise
    except OSError as error:
        os.close(fd)
        # full, or a write error: the plain way would fail as well, and leave an empty file
        if error.filename is None:
            raise
        return -1
    finally:
        with contextlib.suppress(OSError):
            folder.unlink(other)
    return folder.reopened(fd, name)


def _write(fd: int, at: int, data: bytes) -> None:
    done = 0
    if hasattr(os, "pwrite"):
        while done < len(data):  # a nearly full disk takes a part
            done += os.pwrite(fd, data[done:] if done else data, at + done)
        return
    os.lseek(fd, at, os.SEEK_SET)  # Windows
    while done < len(data):
        done += os.write(fd, data[done:])


def _read(fd: int, at: int, count: int) -> bytes:
    if hasattr(os, "pread"):
        return os.pread(fd, count, at)
    os.lseek(fd, at, os.SEEK_SET)  # Windows
    return os.read(fd, count)
