"""Restoration of a file that was deleted while it was open: its bytes are copied to a new name."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path
from typing import NamedTuple

from canid.io.files.derived_name import derived
from canid.io.files.held_folder import HeldFolder
from canid.io.files.new_file import Disk, TakenError
from canid.io.logs.formats import log_suffix
from canid.values.errors import OutputError


class Restored(NamedTuple):
    """The copy; `path` is None where none could be made, and `why` is the reason."""

    path: Path | None
    why: str = ""
    folder: HeldFolder | None = None  # of the copy


def restore(disk: Disk, path: Path, folders: Iterable[HeldFolder]) -> Restored:
    """Copy an open file without a name into its folder, or into the first of `folders` that takes it.

    The copy's name is derived from that of its old `path`.

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
    partial: tuple[HeldFolder, str] | None = None
    for folder in chain((disk.folder,) if disk.folder.usable else (), folders):
        for number in count(1):
            copy = derived(stem, f"-restored{'' if number == 1 else f'-{number}'}{suffix}")
            try:
                disk.copy(copy, folder).close()
            except TakenError:
                continue
            except OutputError as error:
                if folder.has(copy):  # a full disk took some of it
                    if partial is None:
                        partial = folder, copy
                    else:
                        _remove(folder, copy)
                why = why or str(error)
                break
            if partial is not None:
                _remove(*partial)
            return Restored(folder.path / copy, folder=folder)
    if partial is not None:
        why = f"{why}; what could be copied is in {partial[0].path / partial[1]}"
    return Restored(None, why or "no folder is there")


def _remove(folder: HeldFolder, name: str) -> None:
    with contextlib.suppress(OSError):
        folder.unlink(name)
