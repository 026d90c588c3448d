"""Location of an open file: under its name, renamed, deleted, or out of reach."""

from __future__ import annotations

import os
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from canid.io.files import held_folder
from canid.io.files.held_folder import HeldFolder, Standing

# Names that NFS and FUSE give to a deleted file while it is open; it is gone once it is closed.
_DELETED_PREFIXES = (".nfs", ".fuse_hidden")


class Place(Enum):
    """The relation between an open file and a path."""

    HERE = "is under its name"
    COVERED = "is under its name, in a folder that is mounted over"
    MOVED = "was moved"
    DELETED = "was deleted"
    HIDDEN = "is out of reach (its folder was unmounted or covered)"


class Whereabouts(NamedTuple):
    """`path`: the file's own where it has a name, else the one under which it was searched."""

    place: Place
    path: Path

    @property
    def lost(self) -> bool:
        """Whether no name leads to the file any more."""
        return self.place in (Place.DELETED, Place.HIDDEN)


def find(fd: int, path: Path, folder: HeldFolder) -> Whereabouts:
    """Compare an open file (device, inode, link count) with what has its name in its folder, and the folder with its path.

    Where that is unknown, HERE: writing will fail if the file is gone.

    Args:
        fd: the open file.
        path: where it was found last.
        folder: in which it was created.

    Example:
        >>> import tempfile
        >>> folder = HeldFolder(Path(tempfile.mkdtemp()))
        >>> path = folder.path / "a"
        >>> with open(path, "x") as file:
        ...     _ = path.rename(folder.path / "b")
        ...     find(file.fileno(), path, folder).place
        <Place.MOVED: 'was moved'>
    """
    try:
        opened = os.fstat(fd)
        named = folder.status(path.name)
    except OSError:  # EACCES, EIO, ESTALE, ...
        return Whereabouts(Place.HERE, path)
    if named is not None and os.path.samestat(opened, named):
        return _with_its_folder(path, folder)
    if opened.st_nlink == 0:
        return Whereabouts(Place.DELETED, path)
    new = held_folder.path_of(fd)
    if new is not None and _names(new, opened):
        if new.name.startswith(_DELETED_PREFIXES):
            return Whereabouts(Place.DELETED, path)
        return Whereabouts(Place.MOVED, new)
    if new is not None and folder.names(new.name, opened):  # renamed below what covers its folder
        return Whereabouts(Place.MOVED, folder.path / new.name)
    return Whereabouts(Place.HIDDEN, path)


def _with_its_folder(path: Path, folder: HeldFolder) -> Whereabouts:
    """Of a file that has its name in its folder."""
    standing = folder.standing()
    if standing is Standing.GONE:
        return Whereabouts(Place.HIDDEN, path)
    now = folder.path / path.name
    if now != path:
        return Whereabouts(Place.MOVED, now)
    return Whereabouts(Place.COVERED if standing is Standing.COVERED else Place.HERE, path)


def _names(path: Path, opened: os.stat_result) -> bool:
    """Whether the path itself, no link followed, names an open file."""
    try:
        return os.path.samestat(opened, os.lstat(path))
    except OSError:
        return False
