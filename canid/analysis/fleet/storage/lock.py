"""A lock of a folder: one run at a time, released by the system when its process ends, however it ends."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from canid.io.files import opening
from canid.values.errors import OutputError

NAME = "fleet.lock"
# bytes; process id, host and a line of text take less
_MAX_BYTES = 1000
_BEGINNING = "process "


class LockError(OutputError):
    """Another run works in the folder, or may: it is not the disk that is in the way."""


# of this process, by its id and the folder: closing another descriptor of the file would end the lock
_held: dict[tuple[int, int, int], Lock] = {}


class Lock(NamedTuple):
    """A lock that is held."""

    folder: Path
    fd: int

    def check(self) -> None:
        """Raise LockError where the lock's file was removed or replaced: another run may have begun since."""
        if not opening.has_name(self.fd, self.folder / NAME):
            raise LockError(
                f"{self.folder}: {NAME} was removed while this run worked, so that another run may work in this folder: "
                "nothing more is written; end the other one, and the same command goes on"
            )


@contextmanager
def held(folder: Path) -> Iterator[Lock]:
    """Hold the lock, which may be held by this process already: then it is until that one ends.

    It is a POSIX record lock: worker processes that outlive a killed run do not inherit it, and it works on NFS.

    Raises:
        LockError: another run holds it.
        OutputError: its file is a link or another program's, or the file system has no locks.

    Example:
        >>> import tempfile
        >>> with held(Path(tempfile.mkdtemp())) as lock:
        ...     lock.check()
    """
    identity = _identity(folder)
    if identity in _held:
        _held[identity].check()
        yield _held[identity]
        return
    fd = _opened(folder)
    try:
        with suppress(OSError):  # a full disk: the lock holds all the same
            os.ftruncate(fd, 0)
            os.write(fd, f"{_BEGINNING}{os.getpid()} on {socket.gethostname()}".encode())
        yield _held.setdefault(identity, Lock(folder, fd))
    finally:
        _held.pop(identity, None)
        os.close(fd)


def _identity(folder: Path) -> tuple[int, int, int]:
    """This process and a folder. Raises OutputError."""
    try:
        status = os.stat(folder)
    except OSError:
        raise OutputError(f"{folder}: was removed") from None
    return os.getpid(), status.st_dev, status.st_ino


def _opened(folder: Path) -> int:
    """Open and lock the file; it is as it was."""
    path = folder / NAME
    while True:
        try:
            try:
                fd = opening.create(path)
            except FileExistsError:
                fd = opening.existing(path)
        except FileNotFoundError:
            if os.path.isdir(folder):
                continue  # it was removed in between
            raise OutputError(f"{folder}: was removed") from None
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror}); remove it") from None
        try:
            if not is_free(fd):
                raise LockError(
                    f"{folder}: another run writes into it ({_holder(fd)}); wait for it, or choose another folder with -o"
                )
            if not _ours(fd):
                raise OutputError(f"{path}: is no lock of canid fleet: it is left as it is; move it away")
        except OSError as error:
            os.close(fd)
            raise OutputError(f"{path}: cannot be locked ({error.strerror}); use a local disk") from None
        except OutputError:
            os.close(fd)
            raise
        if opening.has_name(fd, path):
            return fd
        os.close(fd)


def is_free(fd: int, *, shared: bool = False, at: int = _MAX_BYTES) -> bool:
    """Lock an open file for this process until it closes any descriptor of it; False where another process has it.

    Args:
        fd: of the file.
        shared: others may hold it so as well; for a descriptor that only reads.
        at: byte that is locked on Windows, where it cannot be read: one beyond the content.

    Raises:
        OSError: the file system has no locks.
    """
    try:
        _lock(fd, shared, at)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN, errno.EDEADLK):
            return False
        raise
    return True


def _lock(fd: int, shared: bool, at: int) -> None:
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        os.lseek(fd, at, os.SEEK_SET)
        msvcrt.locking(fd, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        os.lseek(fd, 0, os.SEEK_SET)
        return
    fcntl.lockf(fd, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


def _ours(fd: int) -> bool:
    """Whether a lock's text is in the file, or nothing."""
    os.lseek(fd, 0, os.SEEK_SET)
    text = os.read(fd, _MAX_BYTES)
    os.lseek(fd, 0, os.SEEK_SET)
    return os.fstat(fd).st_size <= _MAX_BYTES and (not text or text.startswith(_BEGINNING.encode()))


def _holder(fd: int) -> str:
    with suppress(OSError):
        os.lseek(fd, 0, os.SEEK_SET)
        return os.read(fd, _MAX_BYTES).decode("utf-8", "replace") or "a process that has just begun"
    return "unknown process"
