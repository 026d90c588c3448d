"""`write_log`: a stream of frames as a log file; the suffix chooses the format."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import Protocol

from canid import timestamps
from canid.errors import ConfigError
from canid.files.new_file import Disk, TakenError
from canid.frame_columns import chunks
from canid.logs.blf.blf_writer import BlfWriter
from canid.logs.formats import log_suffix
from canid.types import NAN, Columns, Event, Frame


class Writer(Protocol):
    """A writer of any format; all methods but `abandon` raise OutputError where the disk fails."""

    start_ns: int | None  # epoch ns of t = 0; may be assigned until the first `append`
    lead_ns: int  # how far the file's own zero lies before t = 0, for frames stamped before the first
    frames: int  # appended

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def disk(self) -> Disk:
        """The file on the disk."""

    @property
    def kept(self) -> int:
        """Frames that are in the file already."""

    @property
    def bytes(self) -> int:
        """Bytes in the file so far."""

    @property
    def waiting(self) -> int:
        """Bytes that were appended and not written yet; in the file they are no more than that, but for a header."""

    def append(self, frame: Frame) -> None:
        """Take one frame."""

    def append_columns(self, chunk: Columns) -> None:
        """Take frames; where that fails, `frames` says how many were taken.

        Raises ValueError, before any is taken, where the format cannot hold one of them.
        """

    def note(self, event: Event) -> None:
        """Write an event between the frames, where the format can."""

    def checkpoint(self, *, sync: bool = True) -> None:
        """Make the file complete as it stands."""

    def sync(self) -> None:
        """Sync what was written to the disk itself; another thread may call this at any time."""

    def complete(self) -> None:
        """Write the end, and have all of it on the disk; the file stays open."""

    def close(self) -> None:
        """Write the end and close."""

    def abandon(self) -> None:
        """Close without writing any more."""


_TEXT_WRITERS = {".asc": "AscWriter", ".log": "CandumpWriter"}
WRITTEN_SUFFIXES = (".blf", *_TEXT_WRITERS)


def open_writer(path: str | os.PathLike[str], start_ns: int | None = None) -> Writer:
    """Open a writer for the path's suffix (one of `WRITTEN_SUFFIXES`).

    Raises ConfigError for another suffix, OutputError where the file exists or cannot be created.
    """
    suffix = check_suffix(path)
    if suffix == ".blf":
        return BlfWriter(path, start_ns)
    kind = getattr(importlib.import_module("canid.logs.text_writers"), _TEXT_WRITERS[suffix])
    writer: Writer = kind(path, start_ns)
    return writer


def check_suffix(path: str | os.PathLike[str]) -> str:
    """Return the suffix; raises ConfigError where the format is not written."""
    suffix = log_suffix(path)
    if suffix not in WRITTEN_SUFFIXES:
        raise ConfigError(
            f"{path}: cannot write the format {suffix or '(no suffix)'!r}; choose {', '.join(WRITTEN_SUFFIXES)}"
        )
    return suffix


def open_new(path: str | os.PathLike[str], first: int = 1) -> Writer:
    """Open a writer for a file of this name or, where it is taken, the next free one: name-2.blf, ...

    `first`: 2 leaves out the name itself. `writer.path` is the name. No other process can get the same one.
    Raises as `open_writer`.
    """
    path = Path(path)
    suffix = log_suffix(path)
    stem = path.name[: len(path.name) - len(suffix)]
    for number in count(first):
        name = path if number == 1 else path.with_name(f"{stem}-{number}{path.suffix}")
        try:
            return open_writer(name)
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
    Raises OutputError where the file exists already or cannot be written.

    >>> import tempfile
    >>> write_log(f"{tempfile.mkdtemp()}/drive.log", [Frame(0.0, 0, 0x123, b"abc")], 1533224087.0)
    """
    writer = open_writer(path, timestamps.epoch_ns(start_utc))
    try:
        for chunk in chunks(frames):
            writer.append_columns(chunk)
    finally:
        writer.close()
