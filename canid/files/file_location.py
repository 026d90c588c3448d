"""Location of an open file: under its name, renamed, deleted, or out of reach."""

from __future__ import annotations

import contextlib
import os
from enum import Enum
from pathlib import Path
from typing import NamedTuple

# Names that NFS and FUSE give to a deleted file while it is open; it is gone once it is closed.
_DELETED_PREFIXES = (".nfs", ".fuse_hidden")
# macOS' limit of a path's length, which F_GETPATH needs as the size of its buffer
_MAC_PATH_MAX = 1024


class Place(Enum):
    """The relation between an open file and a path."""

    HERE = "is under its name"
    MOVED = "was moved"
    DELETED = "was deleted"
    HIDDEN = "is out of reach (its folder was unmounted or covered)"


class Whereabouts(NamedTuple):
    """`path`: the file's own where it is HERE or MOVED, else the one under which it was searched."""

    place: Place
    path: Path

    @property
    def lost(self) -> bool:
        """Whether no name leads to the file any more."""
        return self.place in (Place.DELETED, Place.HIDDEN)


def find(fd: int, path: Path) -> Whereabouts:
    """Compare an open file (device, inode, link count) with what its path names.

    Where that is unknown, HERE: writing will fail if the file is gone.

    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with open(folder / "a", "x") as file:
    ...     _ = os.rename(folder / "a", folder / "b")
    ...     find(file.fileno(), folder / "a").place is Place.HERE
    False
    """
    try:
        opened = os.fstat(fd)
        named = _named(path)
    except OSError:  # EACCES, EIO, ESTALE, ...
        return Whereabouts(Place.HERE, path)
    if named is not None and os.path.samestat(opened, named):
        return Whereabouts(Place.HERE, path)
    if opened.st_nlink == 0:
        return Whereabouts(Place.DELETED, path)
    new = _path_of(fd)
    if new is not None:
        with contextlib.suppress(OSError):
            named = _named(new)
            if named is not None and os.path.samestat(opened, named):
                deleted = new.name.startswith(_DELETED_PREFIXES)
                return Whereabouts(Place.DELETED, path) if deleted else Whereabouts(Place.MOVED, new)
    return Whereabouts(Place.HIDDEN, path)


def folder_of(fd: int, path: Path) -> Path | None:
    """Path of an open folder, which may have been renamed; None where it was removed or is out of reach."""
    for named in (path, _path_of(fd)):
        with contextlib.suppress(OSError):
            # a folder may be reached through a link
            if named is not None and os.path.samestat(os.fstat(fd), os.stat(named)):
                return named
    return None


def _named(path: Path) -> os.stat_result | None:
    """The status of what the path itself names, no link followed; None: nothing."""
    try:
        return os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        return None


def _path_of(fd: int) -> Path | None:
    """The path of an open file as the system reports it; None where it does not."""
    try:
        return Path(os.readlink(f"/proc/self/fd/{fd}"))  # Linux
    except OSError:
        pass
    try:
        import fcntl

        raw = fcntl.fcntl(fd, fcntl.F_GETPATH, bytes(_MAC_PATH_MAX))  # type: ignore[attr-defined,unused-ignore]
        return Path(os.fsdecode(raw.rstrip(b"\0")))
    except (ImportError, AttributeError, OSError):
        return None
