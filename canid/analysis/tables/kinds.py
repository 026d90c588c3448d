"""Which files are tables: by suffix, and for .csv, which CAN logs have too, by the header."""

from __future__ import annotations

import mmap
from pathlib import Path

from canid.io.logs import content, formats
from canid.io.logs.input_file import is_regular
from canid.values.errors import LogError

TEXT_SUFFIXES = (*formats.TABLE_SUFFIXES, *(f"{suffix}.gz" for suffix in formats.TABLE_SUFFIXES))
SUFFIXES = (*TEXT_SUFFIXES, *formats.TABLES_ALONE)
# of an .mf4 that was closed, and the structures of bus logging (ASAM MDF 4)
_MDF = b"MDF     4"
_BUS_EVENTS = (b"CAN_DataFrame", b"CAN_ErrorFrame", b"CAN_RemoteFrame", b"CAN_OverloadFrame", b"LIN_Frame")


def suffix(path: Path) -> str:
    """The suffix, in lower case, with ".gz" where it is compressed."""
    return formats.log_suffix(path)


def is_table(path: str | Path) -> bool:
    """Whether a file is a table of named columns, not a log of CAN frames.

    Raises:
        ConfigError: it lists CAN frames in a way that is not read.

    Example:
        >>> is_table("drive.parquet"), is_table("drive.blf")
        (True, False)
    """
    file = Path(path)
    kind = suffix(file)
    if kind == ".mf4":
        return _is_measurement(file)
    if kind in formats.TABLES_ALONE:
        return True
    if kind not in TEXT_SUFFIXES or not is_regular(file):
        return kind in TEXT_SUFFIXES and not kind.startswith(".csv")
    try:
        form, lines = content.head_of(file)
    except OSError as error:
        raise LogError(f"cannot read {file}: {error.strerror or error}") from None
    if form is None:
        return bool(lines) or not kind.startswith(".csv")
    if form.format is None:
        raise content.refuse(file, form)
    return False


def _is_measurement(file: Path) -> bool:
    """Whether an .mf4 holds signals and no events of a bus: names of channels are never compressed."""
    if not is_regular(file):  # a pipe would be waited for
        return False
    try:
        with file.open("rb") as opened:
            if opened.read(len(_MDF)) != _MDF:
                return False
            with mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return all(data.find(name) < 0 for name in _BUS_EVENTS)
    except (OSError, ValueError):
        return False
