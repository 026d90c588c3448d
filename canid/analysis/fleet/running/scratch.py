"""The folder that a child writes to, in the system's folder for temporary files, and what a kill has left of such.

A confined child may delete what it wrote, but not the folder. So whoever made it locks it as long as it lives: an unlocked
one is left over, and is deleted when the next one is made.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

_PREFIX = "canid-fleet-"
# where a child deletes the folder itself, as on Windows, nothing is locked
_LOCKS = hasattr(os, "O_DIRECTORY")


class Scratch:
    """A folder of this process's own."""

    def __init__(self) -> None:
        """Make it, and delete those of processes that have ended. Raises OSError."""
        for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*") if _LOCKS else ():
            fd = _locked(left)
            if fd is not None:
                shutil.rmtree(left, ignore_errors=True)
                os.close(fd)
        # it has its name once it is locked
        made = Path(tempfile.mkdtemp(prefix=f".{_PREFIX}"))
        self._fd = _locked(made) if _LOCKS else None
        self.path = str(made.rename(made.with_name(made.name.removeprefix("."))))

    def remove(self) -> None:
        """Delete it."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._fd is not None:
            os.close(self._fd)


def _locked(path: Path) -> int | None:
    """A descriptor that locks a folder; None: another process has locked it, or it cannot be locked."""
    import fcntl

    try:
        fd = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(fd)
        return None
    return fd
