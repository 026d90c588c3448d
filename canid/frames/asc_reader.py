"""Reads Vector's .asc: hex or dec, absolute or relative times, classic and CAN FD lines, any locale's date.

Usual lines are read by the thousand (`asc_shapes`, `asc_words`), all others one by one (`asc_line`). What is neither a
frame nor a line of another kind that is known (`asc_events`) is damaged.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from canid.frames import asc_date, asc_events, asc_shapes, asc_words, stamps
from canid.frames.asc_line import Parsed, parse
from canid.frames.asc_usual import Usual, nothing, wide_enough
from canid.frames.columns import Wanted, frames_of, keep_memory, select
from canid.frames.lines import LONGEST_TIME, STEP, Bad, Block, Tally, blocks, line
from canid.frames.read_state import Note, ReadState
from canid.types import Columns, Event, Flag, Frame

# our own writer's line: the start without doubt about zone, language and digits
EXACT_START = "// start, epoch ns: "
_BASE = re.compile(r"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
_DATE = re.compile(r"(?:date\s+|begin\s+triggerblock\s+)(.*)", re.IGNORECASE)
_TIMED = re.compile(r"\d+[.,]\d+$")
# our own writer's events: time in the file, what, says
_EVENT = re.compile(r"// (-?\d{1,9}\.\d+) canid (\w+): (.*)")
# events that are kept until the first frame comes
_EARLY = 1000
# digits of a time: Python converts no more than 4,300, and of a log's have twenty
_LONGEST_WORD = 100
# kinds of lines that matter beyond their number
_HEADER, _COMMENT, _OWN_EVENT = "header lines", "comments", "events"
_REMOTE = int(Flag.REMOTE)


def read_asc(path: Path, state: ReadState) -> Iterator[Frame]:
    """Frames in the order of the file; raises LogError where no line is one."""
    for chunk in read_asc_columns(path, state):
        yield from frames_of(chunk)


def read_asc_columns(path: Path, state: ReadState, wanted: Wanted | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is a frame.

    `wanted`: frames with other ids may be left out.

    The start is local time in this machine's zone, as Vector writes it, unless this package wrote the file.
    """
    keep_memory()
    tally = Tally()
    reading = _Reading(state, tally)
    for block in blocks(path, state, tally):
        chunk = reading.block(block)
        if wanted is not None:
            chunk = select(chunk, wanted.rows(chunk.id))
        if chunk.t.size:
            yield chunk
    tally.close(path, state)


class _Reading:
    """One pass over a file: what the lines so far say about those to come."""

    def __init__(self, state: ReadState, tally: Tally):
        self._state = state
        self._tally = tally
        self._base, self._relative = 16, False
        self._start: int | None = None  # epoch ns of the file's time zero
        self._exact = False
        self._now = 0  # ns, of the latest line with a time
        self._first: int | None = None  # ns of the first frame
        self._rows = 0  # frames given so far
        self._told: list[
            tuple[int, int, str, str]
        ] = []  # events that wait for the first frame: row, ns, what, says

    def block(self, block: Block) -> Columns:
        """The frames of some lines."""
        usual = asc_shapes.read(block) if self._base == 16 else asc_words.read(block)
        header = self._base, self._relative, self._start, self._exact
        seldom = self._seldom(block, usual)
        if seldom is None:
            # the numbers change their base somewhere in these lines: no line is usual
            self._base, self._relative, self._start, self._exact = header
            usual = nothing(len(block.ends))
            seldom = self._seldom(block, usual)
            assert seldom is not None
        return self._columns(usual, seldom)

    def _seldom(self, block: Block, usual: Usual) -> _Seldom | None:
        """Read all lines that are not usual; None where a usual one cannot be so, because of what they say."""
        seldom = _Seldom(self._relative, self._start)
        ends = block.ends
        misses = []
        base = self._base
        # empty lines are passed over together: a bomb may hold millions of them
        filled = np.diff(ends, prepend=0) > 1
        filled[-1] |= not block.data.endswith(b"\n")
        for n, k in enumerate(np.flatnonzero(~usual.found & filled).tolist()):
            if n % STEP == 0:
                self._state.unpacked = block.at + int(ends[k])
            item = line(block, k, int(ends[k - 1]) if k else 0, int(ends[k]))
            words = item.text.split()
            if not words:
                continue
            if not _TIMED.match(words[0]):
                if kind := self._header(item.text, seldom, k):
                    seldom.kinds[kind] += 1
                else:
                    misses.append((item, "it is no line of an ASC log"))
                if self._base != base and usual.found.any():
                    return None
                continue
            ns = stamps.from_text(words[0]) if len(words[0]) <= _LONGEST_WORD else LONGEST_TIME + 1
            if ns > LONGEST_TIME:
                misses.append((item, "its time is damaged"))
                continue
            seldom.timed.append((k, ns))
            try:
                parsed = parse(words, self._base, item)
            except ValueError as error:
                misses.append((item, str(error) if isinstance(error, Bad) else "it is no frame"))
                continue
            if parsed is not None:
                seldom.frames.append((k, parsed))
            elif kind := asc_events.timed(words[1:]):
                seldom.kinds[kind] += 1
            else:
                misses.append((item, "it is no line of an ASC log" if item.whole else "the file ends in it"))
        for item, why in misses:
            self._tally.miss(item, why)
        self._tally.events += seldom.kinds.pop(_OWN_EVENT, 0)
        self._tally.others.update(seldom.kinds)
        return seldom

    def _header(self, text: str, seldom: _Seldom, k: int) -> str:
        """Take a line without a time: its kind, "" where it is none of the format."""
        text = text.strip().removeprefix("\xef\xbb\xbf")
        exact = text[len(EXACT_START) :] if text.startswith(EXACT_START) else ""
        kind = _HEADER
        if exact.isdecimal() and len(exact) <= _LONGEST_WORD:
            self._start, self._exact = int(exact), True
            kind = _COMMENT
        elif found := _BASE.fullmatch(text):
            self._base = 10 if found[1].lower() == "dec" else 16
            self._relative = (found[2] or "").lower() == "relative"
            seldom.relative.append((k, self._relative))
        elif not (known := asc_events.untimed(text)):
            return ""
        elif (found := _DATE.match(text)) and not self._exact:
            # the begin of the trigger block comes later and is nearer to time zero than the file's date
            at = asc_date.local_ns(found[1])
            self._start = self._start if at is None else at
        elif found := _EVENT.match(text):
            if self._state.notes is not None:
                seldom.told.append((k, stamps.from_text(found[1]), found[2], found[3]))
            kind = _OWN_EVENT
        else:
            return known
        seldom.starts.append((k, self._start))
        return kind

    def _columns(self, usual: Usual, seldom: _Seldom) -> Columns:
        """Put usual and other lines together, and give them their times."""
        usual = _merged(usual, seldom)
        found = usual.found
        timed = found.copy()
        ns = usual.ns
        for k, at in seldom.timed:
            timed[k], ns[k] = True, at
        now = self._times(ns, timed, seldom)
        self._tally.read += int(found.sum())
        if self._first is None and found.any():
            k = int(found.argmax())
            self._first = int(now[k])
            start = [start for at, start in seldom.starts if at < k][-1]
            self._state.start_ns = None if start is None else start + self._first
        if timed.any():
            self._now = int(now[np.flatnonzero(timed)[-1]])
        if self._state.notes is not None:
            self._note(self._state.notes, seldom, found)
        self._rows += int(found.sum())
        t = (now - (self._first or 0)).astype(np.float64) * 1e-9
        chunk = Columns(t, usual.bus, usual.id, usual.flags, usual.length, usual.data)
        return chunk if found.all() else select(chunk, found)

    def _note(self, notes: list[Note], seldom: _Seldom, found: npt.NDArray[np.bool_]) -> None:
        """Give out the events, as soon as there is a time that theirs can count from."""
        told = [(self._rows + int(found[:k].sum()), ns, what, says) for k, ns, what, says in seldom.told]
        if self._first is None:
            self._told = (self._told + told)[:_EARLY]
            return
        for row, ns, what, says in self._told + told:
            notes.append(Note(row, Event((ns - self._first) * 1e-9, what, says)))
        self._told = []

    def _times(
        self, ns: npt.NDArray[np.int64], timed: npt.NDArray[np.bool_], seldom: _Seldom
    ) -> npt.NDArray[np.int64]:
        """Give each line its time, of which relative ones are the sum so far."""
        if not any(relative for _, relative in seldom.relative):
            return ns
        ns = np.where(timed, ns, 0)
        now = self._now
        borders = [k for k, _ in seldom.relative] + [len(ns)]
        for (_, relative), a, b in zip(seldom.relative, borders[:-1], borders[1:], strict=True):
            if relative and b > a:
                ns[a:b] = now + np.cumsum(ns[a:b])
                now = int(ns[b - 1])
            elif timed[a:b].any():
                now = int(ns[a + np.flatnonzero(timed[a:b])[-1]])
        return ns


class _Seldom:
    """Lines that were read one by one; `k` is a line's place in its block."""

    def __init__(self, relative: bool, start: int | None):
        self.timed: list[tuple[int, int]] = []  # k, ns as it stands there
        self.frames: list[tuple[int, Parsed]] = []
        # from which line on times are relative, and which start holds; before the first line: as it was
        self.relative = [(0, relative)]
        self.starts = [(-1, start)]
        self.told: list[tuple[int, int, str, str]] = []  # k, ns, what, says
        self.kinds: Counter[str] = Counter()  # lines that hold no frame


def _merged(usual: Usual, seldom: _Seldom) -> Usual:
    """Put frames that were read one by one in their places."""
    if not seldom.frames:
        return usual
    usual = wide_enough(usual, max(len(parsed.data) for _, parsed in seldom.frames))
    for k, (bus, id_, data, flags, length) in seldom.frames:
        usual.found[k] = True
        usual.bus[k], usual.id[k], usual.flags[k] = bus, id_, flags
        usual.length[k] = length if flags & _REMOTE else len(data)
        usual.data[k, : len(data)] = np.frombuffer(data, np.uint8)
    return usual
