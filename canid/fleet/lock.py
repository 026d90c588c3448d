"""A lock of a folder: one run at a time, released by the system when its process ends, however it ends."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from canid.errors import OutputError

NAME = "fleet.lock"
# bytes; process id, host and a line of text take less
_MAX_BYTES = 1000


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold the lock.

    It is a POSIX record lock: worker processes that outlive a killed run do not inherit it, and it works on NFS.

    Raises:
        OutputError: another run holds it, or the file system has no locks.

    Example:
        >>> import tempfile
        >>> with held(Path(tempfile.mkdtemp())):
        ...     pass
    """
    path = folder / NAME
    try:
        fd = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
    try:
        try:
            _lock(fd)
        except OSError as error:
            if error.errno in (errno.EACCES, errno.EAGAIN, errno.EDEADLK):
                raise OutputError(
                    f"{folder}: another run writes into it ({_holder(fd)}); wait for it, or choose another folder with -o"
                ) from None
            raise OutputError(f"{path}: cannot be locked ({error.strerror}); use a local disk") from None
        with suppress(OSError):  # a full disk: the lock holds all the same
            os.ftruncate(fd, 0)
            os.write(fd, f"process {os.getpid()} on {socket.gethostname()}".encode())
        yield
    finally:
        os.close(fd)


def _lock(fd: int) -> None:
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        # beyond the text, so that others can read it
        os.lseek(fd, _MAX_BYTES, os.SEEK_SET)
        msvcrt.locking(fd, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        os.lseek(fd, 0, os.SEEK_SET)
        return
    fcntl.lockf(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _holder(fd: int) -> str:
    with suppress(OSError):
        os.lseek(fd, 0, os.SEEK_SET)
        return os.read(fd, _MAX_BYTES).decode("utf-8", "replace") or "a process that has just begun"
    return "unknown process"
