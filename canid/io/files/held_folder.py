"""A folder by its descriptor: it stays the one that it was, whatever its path comes to lead to.

Names are created, looked up, renamed and deleted in it with the calls of openat(2), so that a file system that is mounted
over it, a link in its place or another name changes nothing. On systems without them (Windows) the path is used.
"""

from __future__ import annotations

import os
import weakref
from contextlib import suppress
from enum import Enum
from pathlib import Path

from canid.io.files import opening

# all functions that are used here must support dir_fd; on Windows none does
_BY_DESCRIPTOR = {os.open, os.stat, os.unlink, os.rename, os.link} <= os.supports_dir_fd
# as a path only, where the system has that: listing may not be permitted
_HOLD = getattr(os, "O_PATH", os.O_RDONLY) | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_CLOEXEC", 0)
_READ = (
    os.O_RDONLY
    | getattr(os, "O_NOFOLLOW", 0)
    | getattr(os, "O_NONBLOCK", 0)
    | getattr(os, "O_NOCTTY", 0)
    | getattr(os, "O_CLOEXEC", 0)
    | getattr(os, "O_BINARY", 0)
)
# macOS' limit of a path's length, which F_GETPATH needs as the size of its buffer
_MAC_PATH_MAX = 1024
# behind the path of a removed folder, as Linux reports it
_DELETED = " (deleted)"
_MOUNTS = "/proc/self/mountinfo"


class Standing(Enum):
    """What became of a folder."""

    SHOWN = "is under its path"
    COVERED = "is covered: its path leads to another folder now"
    GONE = "was removed, or its file system was unmounted"


class HeldFolder:
    """A folder that is open as long as anybody holds this value.

    Example:
        >>> import tempfile
        >>> parent = Path(tempfile.mkdtemp())
        >>> (parent / "a").mkdir()
        >>> folder = HeldFolder(parent / "a")
        >>> _ = (parent / "a").rename(parent / "b")
        >>> os.close(folder.create("new"))
        >>> folder.standing(), folder.path.name, [each.name for each in (parent / "b").iterdir()]
        (<Standing.SHOWN: 'is under its path'>, 'b', ['new'])
    """

    def __init__(self, path: Path):
        """Open it. Raises OSError."""
        self.path = path  # as it was found last
        with suppress(OSError):  # the process's own folder may be removed
            path = Path(os.getcwd()) / path
        self._absolute = path
        self.fd: int | None = None
        self._counted = (
            False  # its names are counted, so that a removed one has none; not on every FUSE file system
        )
        if _BY_DESCRIPTOR:
            self.fd = os.open(self.path, _HOLD)
            # not at the end of the process: threads that do not end before may hold it
            weakref.finalize(self, os.close, self.fd).atexit = False
            self._counted = os.fstat(self.fd).st_nlink > 0
        self._known = None if self.fd is None else path_of(self.fd)

    def at(self, name: str) -> str:
        """What a call with `dir_fd=self.fd` takes for a name in it."""
        return name if self.fd is not None else str(self.path / name)

    def create(self, name: str, *, append: bool = False, mode: int = opening.MODE) -> int:
        """As `opening.create`."""
        return opening.create(self.at(name), append=append, mode=mode, dir_fd=self.fd)

    def create_temporary(
        self, name: str, *, append: bool = False, mode: int = opening.MODE
    ) -> tuple[int, str]:
        """As `opening.create_temporary`; returns descriptor and name."""
        fd, path = opening.create_temporary(Path(self.at(name)), append=append, mode=mode, dir_fd=self.fd)
        return fd, path.name

    def existing(self, name: str, *, append: bool = False) -> int:
        """As `opening.existing`."""
        return opening.existing(self.at(name), append=append, dir_fd=self.fd)

    def reopened(self, fd: int, name: str) -> int:
        """As `opening.reopened`."""
        return opening.reopened(fd, Path(self.at(name)), dir_fd=self.fd)

    def read(self, name: str) -> int:
        """Open a file for reading, through no link; returns its descriptor. Raises OSError."""
        return os.open(self.at(name), _READ, dir_fd=self.fd)

    def status(self, name: str) -> os.stat_result | None:
        """Of what has this name, no link followed; None: nothing. Raises OSError."""
        try:
            return os.stat(self.at(name), dir_fd=self.fd, follow_symlinks=False)
        except (FileNotFoundError, NotADirectoryError):
            return None

    def has(self, name: str) -> bool:
        """Whether something has this name; False where that is unknown."""
        with suppress(OSError):
            return self.status(name) is not None
        return False

    def names(self, name: str, opened: os.stat_result) -> bool:
        """Whether an open file has this name; False where that is unknown."""
        with suppress(OSError):
            named = self.status(name)
            return named is not None and os.path.samestat(named, opened)
        return False

    def rename(self, name: str, new: str) -> None:
        """Rename a file, over what has the new name. Raises OSError."""
        os.replace(self.at(name), self.at(new), src_dir_fd=self.fd, dst_dir_fd=self.fd)

    def link(self, name: str, new: str) -> None:
        """Give a file a second name. Raises OSError, FileExistsError."""
        os.link(self.at(name), self.at(new), src_dir_fd=self.fd, dst_dir_fd=self.fd, follow_symlinks=False)

    def unlink(self, name: str) -> None:
        """Delete a name. Raises OSError."""
        os.unlink(self.at(name), dir_fd=self.fd)

    def sync(self) -> None:
        """Sync its names, as `opening.sync_folder`."""
        opening.sync_folder(Path("." if self.fd is not None else self.path), dir_fd=self.fd)

    def is_same(self, other: HeldFolder) -> bool:
        """Whether both are one folder."""
        if self.fd is None or other.fd is None:
            return self.path == other.path
        return self is other or os.path.samestat(os.fstat(self.fd), os.fstat(other.fd))

    @property
    def usable(self) -> bool:
        """Whether files that are created in it have a name that can lead to them. Follows no path, and so never waits."""
        if self.fd is None:
            return os.path.isdir(self.path)
        with suppress(OSError):
            return not (self._counted and os.fstat(self.fd).st_nlink == 0) and not _detached(self.fd)
        return False

    def follow(self) -> None:
        """Set `path` to its new one where it was renamed. Follows no path, and so never waits."""
        now = path_of(self.fd) if self.fd is not None and self.usable else None
        if now is not None and now != self._known and not now.name.endswith(_DELETED):
            self.path = self._absolute = self._known = now

    def standing(self) -> Standing:
        """Where it is now; `path` is its new one where it was renamed."""
        if not self.usable:
            return Standing.GONE
        self.follow()
        if self.fd is None or _leads_to(self._absolute, self.fd):
            return Standing.SHOWN
        now = path_of(self.fd)
        if now is None or not _leads_to(now, self.fd):
            # a removed folder of a file system that keeps no count of its names
            return Standing.GONE if now is not None and now.name.endswith(_DELETED) else Standing.COVERED
        self.path = self._absolute = now  # a link led to it, and does no longer
        return Standing.SHOWN


def path_of(fd: int) -> Path | None:
    """The path of an open file or folder as the system reports it; None where it does not."""
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


def _leads_to(path: Path, fd: int) -> bool:
    """Whether a path leads to an open folder, through a link too."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(fd), os.stat(path))
    return False


def _detached(fd: int) -> bool:
    """Whether the mount through which a folder was opened is gone, as after `umount --lazy`; False where unknown."""
    with suppress(OSError, IndexError):
        with open(f"/proc/self/fdinfo/{fd}", "rb") as about:
            number = next((line.split()[1] for line in about if line.startswith(b"mnt_id:")), None)
        with open(_MOUNTS, "rb") as mounts:
            return number is not None and not any(line.split(b" ", 1)[0] == number for line in mounts)
    return False
