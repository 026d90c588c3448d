"""Bounded reading of a configuration file: regular files up to a size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from canid.signals.vehicle.quoting import brief
from canid.values.errors import ConfigError
from canid.values.processes.kernel_files import of_the_kernel


def read(path: Path, largest: int, what: str) -> bytes:
    """Read a whole file; a pipe, a device or a socket is never waited for, nor read.

    Args:
        path: of the file.
        largest: bytes that it may have.
        what: it is, in a sentence: "DBC file".

    Raises:
        ConfigError: there is none, it is not a regular file, it is too large, or it cannot be read.

    Example:
        >>> read(Path("/dev/zero"), 1000, "vehicle file")
        Traceback (most recent call last):
        canid.values.errors.ConfigError: vehicle file /dev/zero is not a regular file
    """
    # a path is quoted in full, unless it is not readable text
    name = str(path) if str(path).isprintable() and len(str(path)) <= 300 else brief(str(path))
    try:
        # without O_NONBLOCK opening a pipe waits for a writer
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise ConfigError(f"{what} {name} does not exist") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL, or that has no bytes
        if isinstance(error, IsADirectoryError | PermissionError) and os.path.isdir(path):
            raise ConfigError(f"{name} is a folder: name a {what} in it") from None
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise ConfigError(f"{what} {name} cannot be read: {why}") from None
    try:
        status = os.fstat(handle)
        if stat.S_ISDIR(status.st_mode):
            raise ConfigError(f"{name} is a folder: name a {what} in it")
        if not stat.S_ISREG(status.st_mode) or of_the_kernel(status):
            raise ConfigError(f"{what} {name} is not a regular file")
        size = status.st_size
        if size <= largest:
            data = _read(handle, largest + 1)
            size = len(data)  # a file may grow meanwhile, and of some the system reports no size
        if size > largest:
            raise ConfigError(f"{what} {name} has {size:,} bytes; at most {max(largest, 0):,} are read")
        return data
    except OSError as error:
        raise ConfigError(f"{what} {name} cannot be read: {error.strerror}") from None
    finally:
        os.close(handle)


def _read(handle: int, most: int) -> bytes:
    """Up to so many bytes. Raises OSError, BlockingIOError where there is nothing to read at present."""
    parts, left = [], most
    while left > 0 and (part := os.read(handle, min(left, 1 << 20))):
        parts.append(part)
        left -= len(part)
    return b"".join(parts)
