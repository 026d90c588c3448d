"""Recovery of a damaged log: all that can be read of it, in a new file that other programs read too."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.io.files import derived_name
from canid.io.logs.formats import log_suffix
from canid.io.logs.log import Log, open_log
from canid.io.logs.log_writer import WRITTEN_SUFFIXES, check_suffix, open_writer
from canid.io.logs.reader_state import Note
from canid.io.logs.writer import Writer
from canid.values.errors import DamagedLogError, OutputError
from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES, MAX_STANDARD_ID, rows
from canid.values.types import Columns, Damage, Flag

_FD, _ERROR, _EXTENDED, _REMOTE = int(Flag.FD), int(Flag.ERROR), int(Flag.EXTENDED), int(Flag.REMOTE)

# epoch ns, the year 2116: a later start is damage, and no format could hold the times that count from it
_MAX_START_NS = 1 << 62
# formats whose writers hold events
_EVENT_SUFFIXES = (".blf", ".asc")


class Recovered(NamedTuple):
    """The result of `recover`."""

    path: Path  # the copy
    frames: int  # in the copy
    events: int  # the recorder's own, in the copy
    others: int  # lines or objects that hold no CAN frame, which the copy does not have
    start_utc: float  # s, epoch time of the first frame; NaN: not stated in the log
    damage: Damage | None  # what the log has lost; None: nothing
    read: int  # objects that were read; of a text log: lines with a frame
    others_says: str  # how many others there are of each kind; "": none
    remarks: tuple[str, ...] = ()  # how the log was read, where the reader had to decide


def recovered_path(log: str | os.PathLike[str]) -> Path:
    """The default path of the copy, next to the log; a format that canid does not write becomes .blf.

    >>> recovered_path("a/drive.blf").name, recovered_path("drive.2.asc.gz").name, recovered_path("x.LOG").name
    ('drive.recovered.blf', 'drive.2.recovered.blf', 'x.recovered.log')
    """
    log, suffix = Path(log), log_suffix(log)
    stem = log.name[: len(log.name) - len(suffix)]
    return derived_name.sibling(log, stem, f".recovered{suffix if suffix in WRITTEN_SUFFIXES else '.blf'}")


def recover(
    log: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recovered:
    """Write what can be read of a log to a new file.

    Kept are absolute time, buses, directions, ids, data, the kinds of frames and their order, and the events that
    canid's recorder wrote between them (as far as the copy's format can hold them: .blf and .asc hold events).
    `output`: the copy, its suffix chooses the format; default: `recovered_path`. `progress` is called with the share of
    the log that was read, 0 to 1. Memory is bounded, however long the log.

    Raises ConfigError for a missing log or a format that is not written, LogError where not one frame can be read,
    OutputError where the copy exists already or cannot be written.

    >>> import tempfile
    >>> from canid.io.logs.log_writer import write_log
    >>> from canid.values.types import Frame
    >>> path = Path(tempfile.mkdtemp()) / "drive.blf"
    >>> write_log(path, [Frame(0.0, 0, 0x123, b"abc")] * 9, start_utc=1533224087.0)
    >>> _ = path.write_bytes(path.read_bytes() + b"LOBJ, and then nothing that makes sense")
    >>> recovered = recover(path)
    >>> recovered.path.name, recovered.frames, recovered.damage.spans
    ('drive.recovered.blf', 9, ((220, 258),))
    >>> len(list(open_log(recovered.path)))
    9
    """
    target = recovered_path(log) if output is None else Path(output)
    check_suffix(target)
    if os.path.exists(target):
        raise OutputError(f"{target} exists already: choose another name with -o")
    source = open_log(log)
    frames, events = _copy(source, target, progress)
    kept = events if log_suffix(target) in _EVENT_SUFFIXES else 0
    read = frames + (0 if source.format.is_text else source.others)
    if source.damage is not None:
        read = source.damage.read
    return Recovered(
        target,
        frames,
        kept,
        source.others,
        source.start_utc,
        source.damage,
        read,
        source.others_says,
        source.remarks,
    )


def _copy(source: Log, target: Path, progress: Callable[[float], None] | None) -> tuple[int, int]:
    """Copy frames and events; returns how many of each. Raises LogError where damage has left no frame."""
    known = source.start_ns is not None and 0 <= source.start_ns <= _MAX_START_NS
    start_ns = source.start_ns if known else None
    lead_ns = _lead(source)
    writer: Writer | None = None
    events = row = 0
    notes: list[Note] = []
    try:
        for chunk in source.columns(notes=notes):
            if writer is None:
                # not before there is something to write: a failure leaves no empty file
                writer = open_writer(target, start_ns)
                writer.lead_ns = lead_ns
            events += len(notes)
            _write(writer, writable(chunk), notes, row)
            row += len(chunk.t)
            if progress is not None:
                progress(source.progress)
        if writer is None:
            if source.damage is not None:
                raise DamagedLogError(f"{source.path} holds no frame that can be read ({source.damage.says})")
            writer = open_writer(target, start_ns)  # a recording of a silent bus
        events += len(notes)
        for note in notes:
            writer.note(note.event)
    finally:
        if writer is not None:
            writer.close()
    return writer.frames, events


def _write(writer: Writer, chunk: Columns, notes: list[Note], row: int) -> None:
    """Write a chunk that begins at `row`, each event before the frame that it precedes; empties `notes`."""
    begin, n = 0, len(chunk.t)
    for note in notes:
        end = min(max(note.row - row, begin), n)
        writer.append_columns(rows(chunk, begin, end))
        writer.note(note.event)
        begin = end
    writer.append_columns(rows(chunk, begin, n))
    notes.clear()


def writable(chunk: Columns) -> Columns:
    """Make frames of a damaged log consistent, so that every format can hold them.

    More than eight bytes make a frame CAN FD, an id of more than 11 bits makes it extended.

    >>> from canid.values.frame_columns import columns_of
    >>> from canid.values.types import Frame
    >>> writable(columns_of([Frame(0.0, 0, 0x12345, bytes(12))])).flags.tolist() == [Flag.EXTENDED | Flag.FD]
    True
    """
    flags, length, data = chunk.flags.copy(), chunk.length, chunk.data
    error, has_data = (flags & _ERROR) != 0, (flags & _REMOTE) == 0
    flags[~error & (chunk.id > MAX_STANDARD_ID)] |= _EXTENDED
    shortened = np.where(error & has_data, np.minimum(length, CLASSIC_BYTES), length)
    flags[has_data & (shortened > CLASSIC_BYTES)] |= _FD
    shortened = np.where(has_data, np.minimum(shortened, FD_BYTES), shortened)
    if (shortened != length).any():
        data = np.where(np.arange(data.shape[1]) < np.where(has_data, shortened, 0)[:, None], data, 0)
    return chunk._replace(flags=flags, length=shortened, data=data)


def _lead(source: Log) -> int:
    """How far before the first frame the earliest one is, ns: no format has times before its zero."""
    notes: list[Note] = []
    earliest = min((float(chunk.t.min()) for chunk in source.columns(notes=notes)), default=0.0)
    earliest = min(earliest, *(note.event.t for note in notes), 0.0)
    return round(-earliest * 1e9)
