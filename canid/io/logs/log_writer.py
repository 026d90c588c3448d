"""`write_log`: a stream of frames as a log file; the suffix chooses the format."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterable
from itertools import count
from pathlib import Path

from canid.io.files import derived_name
from canid.io.files.held_folder import HeldFolder
from canid.io.files.new_file import TakenError
from canid.io.logs.blf.blf_writer import BlfWriter
from canid.io.logs.formats import log_suffix
from canid.io.logs.writer import Writer
from canid.values import timestamps
from canid.values.errors import ConfigError
from canid.values.frame_columns import chunks
from canid.values.types import NAN, Frame

_TEXT_WRITERS = {".asc": "AscWriter", ".log": "CandumpWriter"}
WRITTEN_SUFFIXES = (".blf", *_TEXT_WRITERS)


def open_writer(
    path: str | os.PathLike[str], start_ns: int | None = None, folder: HeldFolder | None = None
) -> Writer:
    """Open a writer for the path's suffix (one of `WRITTEN_SUFFIXES`).

    `folder`: in which its name is created, wherever its path leads; None: what it leads to now.

    Raises ConfigError for another suffix, OutputError where the file exists or cannot be created.
    """
    suffix = check_suffix(path)
    if suffix == ".blf":
        return BlfWriter(path, start_ns, folder)
    kind = getattr(importlib.import_module("canid.io.logs.text_writers"), _TEXT_WRITERS[suffix])
    writer: Writer = kind(path, start_ns, folder)
    return writer


def check_suffix(path: str | os.PathLike[str]) -> str:
    """Return the suffix; raises ConfigError where the format is not written."""
    suffix = log_suffix(path)
    if suffix not in WRITTEN_SUFFIXES:
        raise ConfigError(
            f"{path}: cannot write the format {suffix or '(no suffix)'!r}; choose {', '.join(WRITTEN_SUFFIXES)}"
        )
    return suffix


def open_new(path: str | os.PathLike[str], first: int = 1, folder: HeldFolder | None = None) -> Writer:
    """Open a writer for a file of this name or, where it is taken, the next free one: name-2.blf, ...

    `first`: 2 leaves out the name itself; `folder`: as of `open_writer`. `writer.path` is the name. No other process can
    get the same one.
    Raises as `open_writer`.
    """
    path = Path(path)
    suffix = log_suffix(path)
    stem = path.name[: len(path.name) - len(suffix)]
    for number in count(first):
        name = path if number == 1 else derived_name.sibling(path, stem, f"-{number}{path.suffix}")
        try:
            return open_writer(name, folder=folder)
        except TakenError:
            continue
    raise AssertionError("unreachable")


def write_log(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    start_utc: float = NAN,
) -> None:
    """Write all frames. `start_utc`: epoch s of t = 0 (NaN: unknown), kept to the microsecond.

    A .blf gives back every time bit for bit if it is a whole number of ns (`round(t * 1e9) * 1e-9 == t`) and
    the first frame has t = 0; the text formats keep as many digits as their kind has.
    Raises OutputError where the file exists already or cannot be written, ValueError for a frame before t = 0.

    >>> import tempfile
    >>> write_log(f"{tempfile.mkdtemp()}/drive.log", [Frame(0.0, 0, 0x123, b"abc")], 1533224087.0)
    """
    writer = open_writer(path, timestamps.epoch_ns(start_utc))
    try:
        for chunk in chunks(frames):
            writer.append_columns(chunk)
    finally:
        writer.close()
