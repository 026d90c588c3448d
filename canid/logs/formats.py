"""The log formats that are read: a format is one line here, and the file with its reader.

Everything that lists formats comes from this table: `open_log`, error messages and the help of the verbs. It imports
nothing, so that one format does not pay for the others, nor help for any.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple


class Format(NamedTuple):
    """How a format is read and named."""

    module: str  # with the reader; imported when such a log is opened
    # its function (path, state) -> frames, see `reader_state.Read`. A second function in the module,
    # NAME_columns, gives columns many times faster, see `ReadColumns`; without it the columns are made of the frames.
    reader: str
    description: str  # as help texts name it
    is_text: bool = True  # lines, which `text_lines` reads gzipped as well


FORMATS = {
    ".blf": Format("canid.logs.blf.blf_reader", "read_blf", ".blf", is_text=False),
    ".asc": Format("canid.logs.asc.asc_reader", "read_asc", ".asc"),
    ".log": Format("canid.logs.candump_reader", "read_candump", "candump .log"),
    ".csv": Format("canid.logs.csv_reader", "read_csv", ".csv"),
    ".trc": Format("canid.logs.trc_reader", "read_trc", ".trc"),
    ".mf4": Format("canid.logs.mf4_reader", "read_mf4", ".mf4", is_text=False),
}


def read_suffixes() -> tuple[str, ...]:
    """All suffixes that `open_log` takes.

    >>> read_suffixes()[:2], ".trc.gz" in read_suffixes(), ".blf.gz" in read_suffixes()
    (('.blf', '.asc'), True, False)
    """
    return (*FORMATS, *(f"{suffix}.gz" for suffix, each in FORMATS.items() if each.is_text))


def described() -> str:
    """The formats in words, for help texts.

    >>> described()
    '.blf, .asc, candump .log, .csv, .trc or .mf4'
    """
    *others, last = [each.description for each in FORMATS.values()]
    return f"{', '.join(others)} or {last}"


def log_suffix(path: str | os.PathLike[str]) -> str:
    """Return the suffix that names the format, in lower case, with ".gz" where it is compressed.

    >>> log_suffix("drive.BLF"), log_suffix("drive.2.asc.gz")
    ('.blf', '.asc.gz')
    """
    suffixes = [suffix.lower() for suffix in Path(path).suffixes]
    return "".join(suffixes[-2:] if suffixes[-1:] == [".gz"] else suffixes[-1:])


def format_of(path: str | os.PathLike[str]) -> Format | None:
    """Look up the format of a log; None for an unknown suffix.

    >>> format_of("drive.2.asc.gz").description, format_of("drive.blf.gz")
    ('.asc', None)
    """
    suffix = log_suffix(path)
    return FORMATS[suffix.removesuffix(".gz")] if suffix in read_suffixes() else None
