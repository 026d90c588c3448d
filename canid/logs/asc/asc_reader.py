"""Reads Vector's .asc: hex or dec, absolute or relative times, classic and CAN FD lines, any locale's date.

Lines with hexadecimal numbers in fixed columns are parsed as arrays (`asc_fixed_columns`), all others one by one
(`asc_line`): so logs with decimal numbers (`base dec`), whose columns vary, are read some 38 times slower. What
is neither a frame nor a line of another known kind (`asc_events`) is damaged.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from canid import timestamps
from canid.frame_columns import WantedIds, frames_of, keep_memory, select
from canid.logs.asc import asc_date, asc_events, asc_fixed_columns
from canid.logs.asc.asc_block import LineColumns, none_found, widened
from canid.logs.asc.asc_line import Parsed, parse
from canid.logs.reader_state import Note, ReadState
from canid.logs.text_lines import MAX_TIME_NS, PROGRESS_LINES, Bad, Block, LineCount, blocks, line
from canid.types import Columns, Event, Flag, Frame

# written by canid: the start, independent of time zone, language and digits
EXACT_START_PREFIX = "// start, epoch ns: "
_BASE = re.compile(r"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
_DATE = re.compile(r"(?:date\s+|begin\s+triggerblock\s+)(.*)", re.IGNORECASE)
_TIME_WORD = re.compile(r"\d+[.,]\d+$")
# events written by canid: time in the file, what, says
_EVENT_LINE = re.compile(r"// (-?\d{1,9}\.\d+) canid (\w+): (.*)")
# events that are kept until the first frame comes
_MAX_EARLY_EVENTS = 1000
# Digits of a time; those of logs have up to twenty, and Python converts no more than 4,300.
_MAX_TIME_DIGITS = 100
# kinds of lines that are named in this file
_HEADER_KIND, _COMMENT_KIND, _EVENT_KIND = "header lines", "comments", "events"
_REMOTE = int(Flag.REMOTE)


def read_asc(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one."""
    for chunk in read_asc_columns(path, state):
        yield from frames_of(chunk)


def read_asc_columns(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is a frame.

    `wanted`: frames with other ids may be left out.

    The start is local time in this machine's zone, as Vector writes it, unless this package wrote the file.
    """
    keep_memory()
    count = LineCount()
    reading = _Reading(state, count)
    for block in blocks(path, state, count):
        chunk = reading.block(block)
        if wanted is not None:
            chunk = select(chunk, wanted.rows(chunk.id))
        if chunk.t.size:
            yield chunk
    count.close(path, state)


class _Reading:
    """State of one pass over a file: base, time format and start, as set by the lines so far."""

    def __init__(self, state: ReadState, count: LineCount):
        self._state = state
        self._count = count
        self._base, self._relative = 16, False
        self._start: int | None = None  # epoch ns of the file's time zero
        self._exact = False
        self._now = 0  # ns, of the latest line with a time
        self._first: int | None = None  # ns of the first frame
        self._rows = 0  # frames given so far
        self._early_events: list[
            tuple[int, int, str, str]
        ] = []  # events that wait for the first frame: row, ns, what, says

    def block(self, block: Block) -> Columns:
        """The frames of some lines."""
        fixed = asc_fixed_columns.read(block) if self._base == 16 else none_found(len(block.ends))
        header = self._base, self._relative, self._start, self._exact
        singles = self._read_singly(block, fixed)
        if singles is None:
            # the base of numbers changes within these lines: parse all of them one by one
            self._base, self._relative, self._start, self._exact = header
            fixed = none_found(len(block.ends))
            singles = self._read_singly(block, fixed)
            assert singles is not None
        return self._columns(fixed, singles)

    def _read_singly(self, block: Block, fixed: LineColumns) -> _SingleLines | None:
        """Parse the lines that `fixed` does not hold one by one; None where one of them changes the base of numbers."""
        singles = _SingleLines(self._relative, self._start)
        ends = block.ends
        misses = []
        base = self._base
        # empty lines are skipped together: a hostile file may hold millions of them
        filled = np.diff(ends, prepend=0) > 1
        filled[-1] |= not block.data.endswith(b"\n")
        for n, k in enumerate(np.flatnonzero(~fixed.found & filled).tolist()):
            if n % PROGRESS_LINES == 0:
                self._state.unpacked = block.at + int(ends[k])
            item = line(block, k, int(ends[k - 1]) if k else 0, int(ends[k]))
            words = item.text.split()
            if not words:
                continue
            if not _TIME_WORD.match(words[0]):
                if kind := self._header(item.text, singles, k):
                    singles.kinds[kind] += 1
                else:
                    misses.append((item, "it is no line of an ASC log"))
                if self._base != base and fixed.found.any():
                    return None
                continue
            ns = timestamps.from_text(words[0]) if len(words[0]) <= _MAX_TIME_DIGITS else MAX_TIME_NS + 1
            if ns > MAX_TIME_NS:
                misses.append((item, "its time is damaged"))
                continue
            singles.timed.append((k, ns))
            try:
                parsed = parse(words, self._base, item)
            except ValueError as error:
                misses.append((item, str(error) if isinstance(error, Bad) else "it is no frame"))
                continue
            if parsed is not None:
                singles.frames.append((k, parsed))
            elif kind := asc_events.timed(words[1:]):
                singles.kinds[kind] += 1
            else:
                misses.append((item, "it is no line of an ASC log" if item.whole else "the file ends in it"))
        for item, why in misses:
            self._count.miss(item, why)
        self._count.events += singles.kinds.pop(_EVENT_KIND, 0)
        self._count.others.update(singles.kinds)
        return singles

    def _header(self, text: str, singles: _SingleLines, k: int) -> str:
        """Process a line without a time; returns its kind, "" where it is none of the format."""
        text = text.strip().removeprefix("\xef\xbb\xbf")
        exact = text[len(EXACT_START_PREFIX) :] if text.startswith(EXACT_START_PREFIX) else ""
        kind = _HEADER_KIND
        if exact.isdecimal() and len(exact) <= _MAX_TIME_DIGITS:
            self._start, self._exact = int(exact), True
            kind = _COMMENT_KIND
        elif found := _BASE.fullmatch(text):
            self._base = 10 if found[1].lower() == "dec" else 16
            self._relative = (found[2] or "").lower() == "relative"
            singles.relative.append((k, self._relative))
        elif not (known := asc_events.untimed(text)):
            return ""
        elif (found := _DATE.match(text)) and not self._exact:
            # the begin of the trigger block comes later and is nearer to time zero than the file's date
            at = asc_date.local_ns(found[1])
            self._start = self._start if at is None else at
        elif found := _EVENT_LINE.match(text):
            if self._state.notes is not None:
                singles.events.append((k, timestamps.from_text(found[1]), found[2], found[3]))
            kind = _EVENT_KIND
        else:
            return known
        singles.starts.append((k, self._start))
        return kind

    def _columns(self, fixed: LineColumns, singles: _SingleLines) -> Columns:
        """Merge lines parsed as arrays and one by one, and compute their times."""
        fixed = _merge(fixed, singles)
        found = fixed.found
        timed = found.copy()
        ns = fixed.ns
        for k, at in singles.timed:
            timed[k], ns[k] = True, at
        now = self._times(ns, timed, singles)
        self._count.read += int(found.sum())
        if self._first is None and found.any():
            k = int(found.argmax())
            self._first = int(now[k])
            start = [start for at, start in singles.starts if at < k][-1]
            self._state.start_ns = None if start is None else start + self._first
        if timed.any():
            self._now = int(now[np.flatnonzero(timed)[-1]])
        if self._state.notes is not None:
            self._note(self._state.notes, singles, found)
        self._rows += int(found.sum())
        t = (now - (self._first or 0)).astype(np.float64) * 1e-9
        chunk = Columns(t, fixed.bus, fixed.id, fixed.flags, fixed.length, fixed.data)
        return chunk if found.all() else select(chunk, found)

    def _note(self, notes: list[Note], singles: _SingleLines, found: npt.NDArray[np.bool_]) -> None:
        """Hand out the events, once there is a first frame that their times can count from."""
        events = [(self._rows + int(found[:k].sum()), ns, what, says) for k, ns, what, says in singles.events]
        if self._first is None:
            self._early_events = (self._early_events + events)[:_MAX_EARLY_EVENTS]
            return
        for row, ns, what, says in self._early_events + events:
            notes.append(Note(row, Event((ns - self._first) * 1e-9, what, says)))
        self._early_events = []

    def _times(
        self, ns: npt.NDArray[np.int64], timed: npt.NDArray[np.bool_], singles: _SingleLines
    ) -> npt.NDArray[np.int64]:
        """The absolute time of each line; relative times are summed up."""
        if not any(relative for _, relative in singles.relative):
            return ns
        ns = np.where(timed, ns, 0)
        now = self._now
        borders = [k for k, _ in singles.relative] + [len(ns)]
        for (_, relative), a, b in zip(singles.relative, borders[:-1], borders[1:], strict=True):
            if relative and b > a:
                ns[a:b] = now + np.cumsum(ns[a:b])
                now = int(ns[b - 1])
            elif timed[a:b].any():
                now = int(ns[a + np.flatnonzero(timed[a:b])[-1]])
        return ns


class _SingleLines:
    """Lines that were parsed one by one; `k` is a line's index in its block."""

    def __init__(self, relative: bool, start: int | None):
        self.timed: list[tuple[int, int]] = []  # k, ns as written in the line
        self.frames: list[tuple[int, Parsed]] = []
        # from which line on times are relative, and which start applies; initially as before the block
        self.relative = [(0, relative)]
        self.starts = [(-1, start)]
        self.events: list[tuple[int, int, str, str]] = []  # k, ns, what, says
        self.kinds: Counter[str] = Counter()  # lines that hold no frame


def _merge(fixed: LineColumns, singles: _SingleLines) -> LineColumns:
    """Insert the frames that were parsed one by one."""
    if not singles.frames:
        return fixed
    fixed = widened(fixed, max(len(parsed.data) for _, parsed in singles.frames))
    for k, (bus, id_, data, flags, length) in singles.frames:
        fixed.found[k] = True
        fixed.bus[k], fixed.id[k], fixed.flags[k] = bus, id_, flags
        fixed.length[k] = length if flags & _REMOTE else len(data)
        fixed.data[k, : len(data)] = np.frombuffer(data, np.uint8)
    return fixed
