"""The file of a saved state: replaced atomically, so that it is whole whenever the process is killed."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from canid.io.files import opening
from canid.models.saving.checksum import ours
from canid.values.errors import ConfigError, OutputError

# bytes; thirty times what a window of a minute needs. A longer file is no saved state.
MAX_STATE_BYTES = 16_000_000
# bytes by which a saved state is recognised
_HEAD_BYTES = 64


def read(path: str | Path) -> bytes | None:
    """Read a state file; None where there is none yet.

    Raises:
        ConfigError: it is there and cannot be read.

    Example:
        >>> read("no such file.json") is None
        True
    """
    try:
        if os.path.exists(path) and not os.path.isfile(path):
            raise ConfigError(f"{path} is no file: name the file to which --state may save")
        with open(path, "rb") as file:
            return file.read(MAX_STATE_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"{path}: the state cannot be read ({error.strerror})") from error


def check_writable(path: str | Path) -> None:
    """Check before a drive that the state can be written after it.

    Raises:
        OutputError: it will not.
    """
    target = Path(path).resolve()
    try:
        for left in opening.leftovers(target):  # by a process that was killed
            if _replaceable(left):
                left.unlink(missing_ok=True)
        handle, new = opening.create_temporary(target)
        os.close(handle)
        new.unlink()
        if os.path.exists(path) and not os.access(path, os.W_OK):
            raise PermissionError(0, "it is write-protected")
    except OSError as error:
        raise _unwritable(path, error) from error


def write(path: str | Path, data: bytes) -> None:
    """Replace a state file atomically: a kill in the middle leaves the old one, whole.

    Raises:
        OutputError: it cannot be written, or another file that is no saved state has this name by now; it is kept.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "driver.json"
        >>> write(path, b'{"canid_state": 1, the first')
        >>> write(path, b'{"canid_state": 1, the second')
        >>> read(path), [file.name for file in path.parent.iterdir()]
        (b'{"canid_state": 1, the second', ['driver.json'])
    """
    target = Path(path).resolve()  # a link stays a link

    def check() -> None:
        if not _replaceable(target):
            raise OutputError(f"{path}: exists and is no saved state: it is left as it is")

    try:
        with opening.replacement(target, check) as file:
            file.write(data)
    except OSError as error:
        raise _unwritable(path, error) from error


def _replaceable(target: Path) -> bool:
    """Whether the name belongs to a saved state, to nothing, or to an empty file."""
    try:
        status = os.lstat(target)
        if not stat.S_ISREG(status.st_mode):
            return False
        with open(target, "rb") as file:
            return ours(file.read(_HEAD_BYTES))
    except FileNotFoundError:
        return True


def _unwritable(path: str | Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: the state cannot be written ({error.strerror})")
