"""A state file over a live session: read once, checked before anything begins, replaced by every newer state."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from canid.io.files import state_file
from canid.models.saving.checksum import ours
from canid.values.errors import OutputError


def saved(path: str | Path | None) -> bytes | None:
    """What was saved before; None: nothing, or no file is named.

    Raises:
        ConfigError: the file cannot be read.
        OutputError: it will not be possible to write it later.

    Example:
        >>> saved(None) is None
        True
    """
    if path is None:
        return None
    state = state_file.read(path)
    state_file.check_writable(path)
    return state


def saver(path: str | Path | None, saved: bytes | None) -> Callable[[bytes | None], str]:
    """A function that saves what is newer than what was saved last, and returns why that was not possible.

    Args:
        path: of the state file; None: nothing is saved.
        saved: what the file held before; a file that is no state of canid is never replaced.

    Example:
        >>> saver(None, None)(b"state")
        ''
    """
    last, why = saved, ""

    def save(newest: bytes | None) -> str:
        nonlocal last, why
        if newest is None or newest is last or path is None or not (saved is None or ours(saved)):
            return why
        last = newest
        try:
            state_file.write(path, newest)
        except OutputError as error:
            why = str(error)
        else:
            why = ""
        return why

    return save
