"""The file in which a state outlives the process: whole at any time, whatever kills whoever writes it."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from canid.errors import ConfigError, OutputError

# bytes; thirty times what a window of a minute needs. A longer file is not ours, and not worth the memory.
LARGEST = 16_000_000


def read(path: str | Path) -> bytes | None:
    """Read a state file; None where there is none yet.

    Raises:
        ConfigError: it is there and cannot be read.

    Example:
        >>> read("no such file.json") is None
        True
    """
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise ConfigError(f"{path} is no file: name the file to which --state may save")
        with open(path, "rb") as file:
            return file.read(LARGEST)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"{path}: the state cannot be read ({error.strerror})") from error


def try_out(path: str | Path) -> None:
    """Find out, before a drive, whether the state will be writable after it.

    Raises:
        OutputError: it will not.
    """
    new = _new(path)
    try:
        os.close(os.open(new, os.O_WRONLY | os.O_CREAT))
        new.unlink()
        if Path(path).exists() and not os.access(path, os.W_OK):
            raise PermissionError(0, "it is write-protected")
    except OSError as error:
        raise _unwritable(path, error) from error


def write(path: str | Path, data: bytes) -> None:
    """Replace a state file: who is killed in the middle leaves the old one, whole.

    Raises:
        OutputError: it cannot be written; the old one is still there.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "driver.json"
        >>> write(path, b"first")
        >>> write(path, b"second")
        >>> read(path), [file.name for file in path.parent.iterdir()]
        (b'second', ['driver.json'])
    """
    new = _new(path)
    try:
        with open(new, "wb") as file:
            file.write(data)
            file.flush()
            # before the name: else a power cut can leave the new name on blocks that were never written
            os.fsync(file.fileno())
        os.replace(new, Path(path).resolve())
        _settle(new.parent)
    except OSError as error:
        with suppress(OSError):
            new.unlink()
        raise _unwritable(path, error) from error


def _new(path: str | Path) -> Path:
    """Name the file beside it, always the same: what a kill leaves there is overwritten by the next saving."""
    target = Path(path).resolve()  # a link stays a link
    return target.with_name(f".{target.name}.new")


def _settle(folder: Path) -> None:
    """Bring the new name to the disk, where the system can open a folder."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _unwritable(path: str | Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: the state cannot be written ({error.strerror})")
