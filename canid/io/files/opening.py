"""Opening of files for writing: the only module that does it, so that nothing is written through a link.

A new file is created exclusively, under its own name or under a random one in the same folder. An existing file is opened
only where it is a regular file with one name, and never truncated here. What an option names is checked by its caller
besides (`canid.ui.cli.output.outputs`).
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

# Zero: not on this system.
_ALWAYS = getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
# Opening a FIFO does not block, and no terminal becomes the controlling one.
_NO_EFFECT = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
MODE = 0o666  # less the umask, as open() does
# temporary names that are tried: each is random, so one is enough unless another program interferes
_TRIES = 8
# characters of a name that its temporary name shows: with all of a long one it would be too long
_SHOWN = 40


def create(path: str | Path, *, append: bool = False, mode: int = MODE, dir_fd: int | None = None) -> int:
    """Create a file for reading and writing; returns its descriptor.

    Args:
        path: of the file.
        append: write at its end always.
        mode: permissions, less the umask.
        dir_fd: the open folder from which a relative path is followed, here and below; None: the process's own.

    Raises:
        FileExistsError: something has this name, if only a link to nothing.
        OSError: it cannot be created.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "link"
        >>> path.symlink_to("nothing")
        >>> create(path)
        Traceback (most recent call last):
        FileExistsError: ...
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | _NO_LINK | _ALWAYS | (os.O_APPEND if append else 0)
    return os.open(path, flags, mode, dir_fd=dir_fd)


def create_file(path: str | Path) -> BinaryIO:
    """Create a file as `create` does; returns it as a buffered file."""
    return os.fdopen(create(path), "w+b")


def temporary_name(target: Path, suffix: str = ".new") -> Path:
    """A random name in a file's folder: `.drive.blf.0123456789abcdef.new`."""
    return target.with_name(f".{target.name[:_SHOWN]}.{secrets.token_hex(8)}{suffix}")


def leftovers(target: Path, suffix: str = ".new") -> Iterator[Path]:
    """What has a temporary name for `target`, such as after a kill. Raises OSError."""
    named = re.compile(rf"{re.escape(f'.{target.name[:_SHOWN]}.')}[0-9a-f]{{16}}{re.escape(suffix)}")
    with os.scandir(target.parent) as entries:
        names = [entry.name for entry in entries if named.fullmatch(entry.name)]
    yield from (target.with_name(name) for name in sorted(names))


def create_temporary(
    target: Path, suffix: str = ".new", *, append: bool = False, mode: int = MODE, dir_fd: int | None = None
) -> tuple[int, Path]:
    """Create a file under a random name in the folder of another one; returns descriptor and path. Raises OSError."""
    for _ in range(_TRIES):
        path = temporary_name(target, suffix)
        with suppress(FileExistsError):
            return create(path, append=append, mode=mode, dir_fd=dir_fd), path
    raise OSError(None, "no temporary name is free")


@contextmanager
def replacement(target: Path, check: Callable[[], object] = lambda: None) -> Iterator[BinaryIO]:
    """A new file that takes the name of another one when it is whole and on the disk; on an error nothing is left of it.

    A link of this name is replaced itself, what it leads to stays.

    Args:
        target: its name.
        check: is called just before the file gets its name; raises where it must not.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "a"
        >>> with replacement(path) as file:
        ...     _ = file.write(b"whole")
        >>> [(each.name, each.read_bytes()) for each in path.parent.iterdir()]
        [('a', b'whole')]
    """
    fd, new = create_temporary(target)
    try:
        with os.fdopen(fd, "wb") as file:
            yield file
            file.flush()
            # before the name: else a power cut can leave the name on blocks that were never written
            os.fsync(fd)
        check()
        os.replace(new, target)
    except BaseException:
        with suppress(OSError):
            os.unlink(new)
        raise
    sync_folder(target.parent)


@contextmanager
def private_folder(target: Path) -> Iterator[Path]:
    """A new folder next to `target` into which no other user can write, for programs that open files by their names.

    It is removed at the end, unless it was renamed. Raises OSError.

    Example:
        >>> import tempfile
        >>> parent = Path(tempfile.mkdtemp())
        >>> with private_folder(parent / "tables") as folder:
        ...     folder.parent == parent, folder.name[:8], folder.name[-4:]
        (True, '.tables.', '.new')
        >>> list(parent.iterdir())
        []
    """
    folder = temporary_name(target)
    os.mkdir(folder, 0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def existing(path: str | Path, *, append: bool = False, dir_fd: int | None = None) -> int:
    """Open a regular file that has this one name, for reading and writing; it is as it was. Raises OSError.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "a"
        >>> os.close(create(path))
        >>> os.link(path, path.with_name("b"))
        >>> existing(path)
        Traceback (most recent call last):
        OSError: ...it has another name as well (a hard link)
    """
    # before it is opened: opening a device can do something
    _check(os.stat(path, dir_fd=dir_fd, follow_symlinks=False))
    flags = os.O_RDWR | _NO_LINK | _NO_EFFECT | _ALWAYS | (os.O_APPEND if append else 0)
    return _checked(os.open(path, flags, dir_fd=dir_fd))


def existing_named(path: str | Path, *, write: bool = True) -> int:
    """Open a regular file of one name that an option names, by a symbolic link too. Raises OSError.

    It is as it was: its caller recognises it by its content before it truncates it.

    Args:
        path: of the file.
        write: for reading and writing, or to see only whether that would be permitted later.
    """
    return _checked(os.open(path, (os.O_RDWR if write else os.O_RDONLY) | _NO_EFFECT | _ALWAYS))


def stream(path: str | Path) -> int:
    """Open a pipe, a device or a socket for writing; may wait for a reader. Raises OSError."""
    fd = os.open(path, os.O_WRONLY | getattr(os, "O_NOCTTY", 0) | _ALWAYS)
    if stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        raise OSError(errno.EEXIST, "it has become a file")
    return fd


def reopened(fd: int, path: Path, *, dir_fd: int | None = None) -> int:
    """An open new file under its own name: the system reports a moved file by the name it was opened with.

    The descriptor is closed where it is not the one that is returned.
    """
    try:
        named = os.open(path, os.O_RDWR | _NO_LINK | _ALWAYS, dir_fd=dir_fd)
    except OSError:
        return fd  # write permission may be missing by the umask, or the name be gone already: later checks notice that
    if os.path.samestat(os.fstat(named), os.fstat(fd)):
        os.close(fd)
        return named
    os.close(named)
    return fd


def has_name(fd: int, path: Path) -> bool:
    """Whether an open file has this name, no link followed."""
    try:
        return os.path.samestat(os.fstat(fd), os.lstat(path))
    except OSError:
        return False


def sync_folder(folder: Path, *, dir_fd: int | None = None) -> None:
    """Sync a folder's names: a file whose name is lost is lost."""
    # Windows cannot open folders, and some network file systems cannot sync them
    with suppress(OSError):
        fd = os.open(folder, os.O_RDONLY, dir_fd=dir_fd)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)


def _check(status: os.stat_result) -> None:
    if stat.S_ISLNK(status.st_mode):
        raise OSError(errno.ELOOP, "it is a link")
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "not a regular file")
    if status.st_nlink > 1:
        raise OSError(errno.EMLINK, "it has another name as well (a hard link)")


def _checked(fd: int) -> int:
    try:
        _check(os.fstat(fd))
    except OSError:
        os.close(fd)
        raise
    return fd
