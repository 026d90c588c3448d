"""Restoration of a file that was deleted while it was open: its bytes are copied to a new name."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import NamedTuple

from canid.files.derived_name import derived
from canid.files.new_file import Disk, TakenError
from canid.logs.formats import log_suffix
from canid.values.errors import OutputError


class Restored(NamedTuple):
    """The copy; `path` is None where none could be made, and `why` is the reason."""

    path: Path | None
    why: str = ""


def restore(disk: Disk, path: Path, folders: Iterable[Path]) -> Restored:
    """Copy an open file without a name next to its old `path`, or into the first of `folders` that takes it.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "drive.blf"
    >>> disk = Disk(path)
    >>> disk.append(b"some frames")
    >>> path.unlink()
    >>> restored = restore(disk, path, [])
    >>> restored.path.name, restored.path.read_bytes()
    ('drive-restored.blf', b'some frames')
    """
    suffix = log_suffix(path)
    stem = path.name[: len(path.name) - len(suffix)]
    suffix = path.name[len(stem) :]
    why = ""
    partial: Path | None = None
    for folder in (path.parent, *folders):
        for number in count(1):
            copy = folder / derived(stem, f"-restored{'' if number == 1 else f'-{number}'}{suffix}")
            try:
                disk.copy(copy).close()
            except TakenError:
                continue
            except OutputError as error:
                if os.path.lexists(copy):  # a full disk took some of it
                    if partial is None:
                        partial = copy
                    else:
                        _remove(copy)
                why = why or str(error)
                break
            if partial is not None:
                _remove(partial)
            return Restored(copy)
    return Restored(None, f"{why}; what could be copied is in {partial}" if partial is not None else why)


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
