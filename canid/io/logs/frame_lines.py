"""The loop that readers of text with one frame a line share: the count of each class of lines, and the log's own time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.line_columns import LineColumns, merged
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import (
    MAX_EXTENDED_ID,
    MAX_TIME_NS,
    PROGRESS_LINES,
    Bad,
    Block,
    Line,
    LineCount,
    blocks,
    filled,
    line,
    lines,
)
from canid.values import timestamps
from canid.values.bus_names import MAX_BUSES, with_more
from canid.values.frame_columns import WantedIds, join, keep_memory, select
from canid.values.types import Columns, Flag, Frame

_FLOOR_NS = timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S
# Frames of time 0 that wait for the first one with a time of its own: an adapter that does not stamp what it sends has a
# few of them. More: the log counts from 0.
MAX_WAITING = 4096
_MAX_STANDARD_ID = 0x7FF
# characters of an interface's name
_MAX_NAME = 255


class Row(NamedTuple):
    """A frame as its line has it."""

    ns: int
    bus: int
    id: int
    data: bytes
    flags: int
    length: int = -1  # bytes that a remote frame asks for


# the frame of a line, or the kind of a line that is known to hold none; raises Bad
Take = Callable[[str, Line], Row | str]


def read(
    path: Path, state: ReadState, take: Take, *, dated: Callable[[], bool] = lambda: True
) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one.

    A frame of time 0 between frames of 1990 and later has no time: an adapter does not stamp what it sends itself. It gets
    that of the frame before it, and at the beginning that of the first one with a time.

    Args:
        path: the file.
        state: of this reading.
        take: the frame of a line.
        dated: whether times count from 1970; asked when there is a first frame.
    """
    count = LineCount()
    first: int | None = None
    latest = 0
    waiting: list[Row] = []
    new = tuple.__new__  # a NamedTuple's own __new__ costs twice as much, and there are millions
    for item in lines(path, state, count):
        row = _taken(item, take, count)
        if row is None:
            continue
        ns, bus, id_, data, flags, length = row
        count.read += 1
        if first is None:
            if ns == 0 and len(waiting) < MAX_WAITING and dated():
                waiting.append(row)
                continue
            waited, waiting = waiting, []
            first = ns if ns >= _FLOOR_NS or not waited else 0
            state.start_ns = first if dated() else None
            for early in waited:
                yield _frame(early, 0)
        elif ns == 0 and first >= _FLOOR_NS:
            ns = latest
        latest = ns
        yield new(Frame, ((ns - first) * 1e-9, bus, id_, data, flags, length))
    if waiting:
        state.start_ns = 0 if dated() else None
    for early in waiting:
        yield _frame(early, 0)
    count.close(path, state)


# the frames of a block that can be parsed as arrays
Fast = Callable[[Block], LineColumns]


def read_columns(
    path: Path, state: ReadState, take: Take, fast: Fast, wanted: WantedIds | None = None
) -> Iterator[Columns]:
    """The same as columns, of times since 1970: usual lines as arrays, the others one by one.

    Args:
        path: the file.
        state: of this reading.
        take: the frame of a line.
        fast: the frames of usual lines.
        wanted: frames with other ids may be left out.
    """
    keep_memory()
    count = LineCount()
    times = Times()
    waiting: list[Columns] = []
    for block in blocks(path, state, count):
        fixed = fast(block)
        rows = _one_by_one(block, fixed, take, state, count)
        fixed = merged(fixed, [(k, row[1:]) for k, row in rows])
        for k, row in rows:
            fixed.ns[k] = row.ns
        kept = np.flatnonzero(fixed.found)
        count.read += len(kept)
        before = times.first
        t = times.step(fixed.ns[kept])
        columns = Columns(np.zeros(len(fixed.ns)), *fixed[2:])
        chunk = select(columns, kept)._replace(t=t)
        if times.first is None:
            waiting.append(chunk)
            continue
        if before is None:
            state.start_ns = times.first
            chunk = join([*waiting, chunk]) if waiting else chunk
            waiting = []
        chunk = chunk if wanted is None else select(chunk, wanted.rows(chunk.id))
        if chunk.t.size:
            yield chunk
    if waiting:
        state.start_ns = 0
        yield join(waiting)
    count.close(path, state)


class Times:
    """The log's own time of frames that come in arrays, as `read` gives it to one after the other."""

    def __init__(self) -> None:
        self.first: int | None = None
        self._waiting = 0
        self._latest = 0

    def step(self, ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """Times in s of the next frames; before the first one that has a time all are 0."""
        early = 0
        if self.first is None:
            stamped = np.flatnonzero(ns)
            early = min(int(stamped[0]) if stamped.size else len(ns), MAX_WAITING - self._waiting)
            self._waiting += early
            if early == len(ns):
                return np.zeros(early)
            at = int(ns[early])
            self.first = at if at >= _FLOOR_NS or not self._waiting else 0
            self._latest = at
        stamps = np.concatenate([[self._latest], ns[early:]])
        if self.first >= _FLOOR_NS:
            stamps = stamps[np.maximum.accumulate(np.where(stamps != 0, np.arange(len(stamps)), 0))]
        self._latest = int(stamps[-1])
        return np.concatenate([np.zeros(early), (stamps[1:] - self.first).astype(np.float64) * 1e-9])


def _one_by_one(
    block: Block, fixed: LineColumns, take: Take, state: ReadState, count: LineCount
) -> list[tuple[int, Row]]:
    """The frames of lines that are not parsed yet, each with its row."""
    rows = []
    for n, k in enumerate(np.flatnonzero(~fixed.found & filled(block)).tolist()):
        begin = int(block.ends[k - 1]) if k else 0
        if n % PROGRESS_LINES == 0:
            state.unpacked = block.at + begin
        item = line(block, k, begin, int(block.ends[k]))
        row = _taken(item, take, count)
        if row is not None:
            rows.append((k, row))
    return rows


def _taken(item: Line, take: Take, count: LineCount) -> Row | None:
    """The frame of a line; None: it is none, and counted."""
    text = item.text.strip()
    if not text:
        return None
    try:
        row = take(text, item)
    except Bad as error:
        count.miss(item, str(error))
        return None
    if isinstance(row, str):
        count.others[row] += 1
        return None
    if not -MAX_TIME_NS <= row.ns <= MAX_TIME_NS:
        count.miss(item, "its time is damaged")
        return None
    return row


def _frame(row: Row, ns: int) -> Frame:
    return Frame(ns * 1e-9, row.bus, row.id, row.data, row.flags, row.length)


def checked_id(id_: int, *, extended: bool | None = None) -> tuple[int, int]:
    """An id, and the flag of its width; None: 29 bits where it does not fit 11. Raises Bad.

    >>> checked_id(0x800), checked_id(0x7FF)
    ((2048, <Flag.EXTENDED: 1>), (2047, 0))
    """
    wide = id_ > _MAX_STANDARD_ID if extended is None else extended
    if not 0 <= id_ <= (MAX_EXTENDED_ID if wide else _MAX_STANDARD_ID):
        raise Bad(f"{id_:#x} is too large for an id")
    return id_, Flag.EXTENDED if wide else 0


def bus_of(interface: str, buses: dict[str, int]) -> int:
    """The number of an interface; one that was not there when the names were looked for gets the next. Raises Bad."""
    if interface not in buses:
        if len(interface) > _MAX_NAME:
            raise Bad(f"its interface has a name of {len(interface)} characters")
        if len(buses) >= MAX_BUSES:
            raise Bad(f"it names another interface than the first {MAX_BUSES:,}")
        buses.update(with_more(buses, [interface]))
    return buses[interface]
