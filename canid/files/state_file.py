"""The file of a saved state: replaced atomically, so that it is whole whenever the process is killed."""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from itertools import count
from pathlib import Path

from canid.errors import ConfigError, OutputError
from canid.saving.checksum import ours

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
        if Path(path).exists() and not Path(path).is_file():
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
    try:
        handle, new = _create(path)
        os.close(handle)
        new.unlink()
        if Path(path).exists() and not os.access(path, os.W_OK):
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
    new = None
    try:
        handle, new = _create(path)
        with open(handle, "wb") as file:
            file.write(data)
            file.flush()
            # before the name: else a power cut can leave the new name on blocks that were never written
            os.fsync(file.fileno())
        if not _replaceable(target):
            raise OutputError(f"{path}: exists and is no saved state: it is left as it is")
        os.replace(new, target)
        new = None
        _sync_folder(target.parent)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        if new is not None:
            with suppress(OSError):
                new.unlink()


def _replaceable(target: Path) -> bool:
    """Whether the name belongs to a saved state, to nothing, or to an empty file."""
    try:
        found = os.lstat(target)
        if not stat.S_ISREG(found.st_mode):
            return False
        with open(target, "rb") as file:
            return ours(file.read(_HEAD_BYTES))
    except FileNotFoundError:
        return True


def _create(path: str | Path) -> tuple[int, Path]:
    """Create the temporary file that will replace it; always the same name, unless another program's file has it.

    What a killed process left there is deleted. A link, or a file that is no saved state, is never written to or deleted.
    """
    target = Path(path).resolve()
    for number in count():
        new = target.with_name(f".{target.name}{number or ''}.new")
        while True:
            try:
                return os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666), new
            except FileExistsError:
                if not _replaceable(new):
                    break
                new.unlink(missing_ok=True)
    raise AssertionError("unreachable")


def _sync_folder(folder: Path) -> None:
    """Sync the new name to the disk, where the system can open a folder."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _unwritable(path: str | Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: the state cannot be written ({error.strerror})")
