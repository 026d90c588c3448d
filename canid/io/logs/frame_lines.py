"""The loop that readers of text with one frame a line share: the count of each class of lines, and the log's own time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.line_columns import LineColumns, merged, none_found
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import (
    MAX_TIME_NS,
    PROGRESS_LINES,
    Bad,
    Block,
    Line,
    LineCount,
    blocks,
    filled,
    line,
)
from canid.values import timestamps
from canid.values.bus_names import MAX_BUSES, with_more
from canid.values.frame_columns import MAX_EXTENDED_ID, MAX_STANDARD_ID, WantedIds, join, keep_memory, select
from canid.values.types import Columns, Flag

_FLOOR_NS = timestamps.EPOCH_FLOOR_S * timestamps.NS_PER_S
# Frames of time 0 that wait for the first one with a time of its own: an adapter that does not stamp what it sends has a
# few of them. More: the log counts from 0.
MAX_WAITING = 4096
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


# the frames of a block that can be parsed as arrays
Fast = Callable[[Block], LineColumns]


def _none(block: Block) -> LineColumns:
    return none_found(len(block.ends))


def read(
    path: Path,
    state: ReadState,
    take: Take,
    wanted: WantedIds | None = None,
    *,
    fast: Fast = _none,
    dated: Callable[[], bool] = lambda: True,
) -> Iterator[Columns]:
    """Columns in the order of the file: usual lines as arrays, the others one by one. Raises LogError where no line is one.

    A frame of time 0 between frames of 1990 and later has no time: an adapter does not stamp what it sends itself. It gets
    that of the frame before it, and at the beginning that of the first one with a time.

    Args:
        path: the file.
        state: of this reading; its start is left to `take` where times do not count from 1970.
        take: the frame of a line.
        wanted: frames with other ids may be left out.
        fast: the frames of usual lines.
        dated: whether times count from 1970; asked when there is a first frame that is not a usual line.
    """
    keep_memory()
    count = LineCount()
    times = Times(state, dated)
    for block in blocks(path, state, count):
        fixed = fast(block)
        rows = _one_by_one(block, fixed, take, times, count)
        fixed = merged(fixed, [(k, row[1:]) for k, row in rows])
        fixed.ns[[k for k, _ in rows]] = [row.ns for _, row in rows]
        kept = np.flatnonzero(fixed.found)
        count.took(block.number, kept)
        columns = Columns(np.zeros(len(fixed.ns)), *fixed[2:])
        yield from times.step(fixed.ns[kept], select(columns, kept), wanted)
    if times.waiting:
        state.start_ns = 0
        yield join(times.waiting)
    count.close(path, state)


class Times:
    """The log's own time of frames, see `read`; frames that come before the first one with a time wait for it."""

    def __init__(self, state: ReadState, dated: Callable[[], bool] = lambda: True) -> None:
        self.waiting: list[Columns] = []
        self.state = state
        self._first: int | None = None
        self._early = 0  # frames without a time, at the beginning
        self._latest = 0
        self._dated = True
        self._ask: Callable[[], bool] | None = dated

    def begin(self) -> None:
        """Ask, once, whether times count from 1970."""
        if self._ask is not None:
            self._dated, self._ask = self._ask(), None

    def step(
        self, ns: npt.NDArray[np.int64], chunk: Columns, wanted: WantedIds | None = None
    ) -> Iterator[Columns]:
        """The next frames with their times, s, and at the first time those that waited."""
        begun = self._first is not None
        chunk = chunk._replace(t=self._seconds(ns))
        if self._first is None:
            self.waiting += [chunk] if ns.size else []
            return
        if not begun:
            if self._dated:
                self.state.start_ns = self._first
            chunk, self.waiting = join([*self.waiting, chunk]), []
        chunk = chunk if wanted is None else select(chunk, wanted.rows(chunk.id))
        if chunk.t.size:
            yield chunk

    def _seconds(self, ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        early = 0
        if self._first is None:
            stamped = np.flatnonzero(ns) if self._dated else np.arange(len(ns))
            early = min(int(stamped[0]) if stamped.size else len(ns), MAX_WAITING - self._early)
            self._early += early
            if early == len(ns):
                return np.zeros(early)
            at = int(ns[early])
            self._first = at if at >= _FLOOR_NS or not self._early else 0
            self._latest = at
        stamps = np.concatenate([[self._latest], ns[early:]])
        if self._first >= _FLOOR_NS:
            stamps = stamps[np.maximum.accumulate(np.where(stamps != 0, np.arange(len(stamps)), 0))]
        self._latest = int(stamps[-1])
        return np.concatenate([np.zeros(early), (stamps[1:] - self._first).astype(np.float64) * 1e-9])


def _one_by_one(
    block: Block, fixed: LineColumns, take: Take, times: Times, count: LineCount
) -> list[tuple[int, Row]]:
    """The frames of lines that are not parsed yet, each with its row."""
    rows = []
    ends = [*block.ends.tolist(), 0]
    for n, k in enumerate(np.flatnonzero(~fixed.found & filled(block)).tolist()):
        if n % PROGRESS_LINES == 0:
            times.state.unpacked = block.at + ends[k - 1]
        item = line(block, k, ends[k - 1], ends[k])
        row = _taken(item, take, count)
        if row is not None:
            times.begin()
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


def checked_id(id_: int, *, extended: bool | None = None) -> tuple[int, int]:
    """An id, and the flag of its width; None: 29 bits where it does not fit 11. Raises Bad.

    >>> checked_id(0x800), checked_id(0x7FF)
    ((2048, <Flag.EXTENDED: 1>), (2047, 0))
    """
    wide = id_ > MAX_STANDARD_ID if extended is None else extended
    if not 0 <= id_ <= (MAX_EXTENDED_ID if wide else MAX_STANDARD_ID):
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
