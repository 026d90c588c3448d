"""Reads Vector's .asc: hex or dec, absolute or relative times, classic and CAN FD lines, any locale's date.

Lines with hexadecimal numbers in fixed columns are parsed as arrays (`asc_fixed_columns`), and classic frames with
decimal ones (`asc_decimal_words`); all others one by one (`asc_line`). What is neither a frame nor a line of another
known kind (`asc_events`) is damaged.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.asc import (
    asc_base_line,
    asc_date,
    asc_decimal_words,
    asc_events,
    asc_fd_base,
    asc_fixed_columns,
    asc_names,
)
from canid.io.logs.asc.asc_fd_base import fd_lines
from canid.io.logs.asc.asc_line import NamedMessage, Parsed, parse
from canid.io.logs.asc.asc_times import HeaderLines, LogTimes, Zeros
from canid.io.logs.line_columns import LineColumns, merged, none_found, widened
from canid.io.logs.reader_state import Note, ReadState, SymbolicLogError
from canid.io.logs.text_lines import (
    MAX_TIME_NS,
    PROGRESS_LINES,
    Bad,
    Block,
    Line,
    LineCount,
    LongLine,
    blocks_and_long_lines,
    filled,
    line,
)
from canid.values import timestamps
from canid.values.errors import DamagedLogError
from canid.values.frame_columns import WantedIds, keep_memory, select
from canid.values.types import Columns, Event, Flag

# written by canid: the start, independent of time zone, language and digits
EXACT_START_PREFIX = "// start, epoch ns: "
# written by canid in the line before an error frame, which has no place for its data
ERROR_DATA_PREFIX = "// data of the error frame: "
_ERROR_DATA = re.compile(r"(?:[0-9A-F]{2} ){0,7}[0-9A-F]{2}")
_DATE = re.compile(r"(?:(date)\s+|begin\s+trigger\s?block\s+)(.*)", re.IGNORECASE)
# before the trigger times are negative
_TIME_WORD = re.compile(r"-?\d+[.,]\d+$")
# a time as 0h00m12.345678s
_HMS = re.compile(r"(\d{1,6})h([0-5]\d)m([0-5]\d)[.,](\d{1,20})s")
# events written by canid: time in the file, what, says
_EVENT_LINE = re.compile(r"// (-?\d{1,9}\.\d+) canid (\w+): (.*)")
# events that are kept until the first frame comes
_MAX_EARLY_EVENTS = 1000
# Digits of a time; those of logs have up to twenty, and Python converts no more than 4,300.
_MAX_TIME_DIGITS = 100
# lines with a name for an id that may be damage, before the first frames; and others' ids may be names in such a log: ABBA
# and how many there have to be for each frame
_MAX_NAMES, _SHARE_OF_NAMES = 2, 0.2
_NAMES_REMEDY = (
    "log ids instead of symbolic names, or write a .blf, which has ids, or name their database by --dbc"
)
# kinds of lines that are named in this file
_HEADER_KIND, _COMMENT_KIND, _EVENT_KIND = "header lines", "comments", "events"
_ERROR = int(Flag.ERROR)


def read_asc(path: Path, state: ReadState, wanted: WantedIds | None = None) -> Iterator[Columns]:
    """Columns in the order of the file; raises LogError where no line is a frame.

    `wanted`: frames with other ids may be left out.

    The start is local time in this machine's zone, as Vector writes it, unless this package wrote the file.
    """
    keep_memory()
    count = LineCount()
    reading = _Reading(path, state, count)
    for block in blocks_and_long_lines(path, state, count):
        if not isinstance(block, Block):
            reading.long_line(block)
            continue
        chunk = reading.block(block)
        if wanted is not None:
            chunk = select(chunk, wanted.rows(chunk.id))
        if chunk.t.size:
            yield chunk
    count.close(path, state)


class _Header(NamedTuple):
    """What the header lines so far say."""

    base: int = 16
    fd_base: int = 0  # of CAN FD lines; 0: not decided yet
    relative: bool = False
    zeros: Zeros = Zeros()  # dates from which times may count
    exact: bool = False  # canid wrote it


class _Reading:
    """State of one pass over a file: what its headers say, and the times so far."""

    def __init__(self, path: Path, state: ReadState, count: LineCount):
        self._path = path
        self._state = state
        self._count = count
        self._header = _Header()
        self._times = LogTimes(state)
        self._first: int | None = None  # ns of the first frame
        self._rows = 0  # frames given so far
        self._error_data = -1, b""  # of an error frame in the line of this number
        self._early_events: list[
            tuple[int, int, str, str]
        ] = []  # events that wait for the first frame: row, ns, what, says

    def block(self, block: Block) -> Columns:
        """The frames of some lines."""
        header = self._header
        fixed = none_found(len(block.ends)) if self._state.names else _fast(block, header)
        singles = self._read_singly(block, fixed)
        if singles is None:
            # the base of numbers changes within these lines: parse all of them one by one
            self._header = header
            fixed = none_found(len(block.ends))
            singles = self._read_singly(block, fixed)
            assert singles is not None
        return self._columns(block, fixed, singles)

    def long_line(self, item: LongLine) -> None:
        """A line that is too long to be kept: damaged, unless it begins as one that holds no CAN frame."""
        words = item.head.split()
        timed = bool(words) and _TIME_WORD.match(words[0]) is not None and len(words[0]) <= _MAX_TIME_DIGITS
        kind = asc_events.timed(words[1:]) if timed else asc_events.untimed(item.head.strip())
        if not kind:
            self._count.miss_long(item)
            return
        self._count.others[kind] += 1
        if timed:
            ns = np.array([min(timestamps.from_text(words[0]), MAX_TIME_NS)])
            self._times.absolute(ns, np.ones(1, bool), _SingleLines(self._header))

    def _read_singly(self, block: Block, fixed: LineColumns) -> _SingleLines | None:
        """Parse the lines that `fixed` does not hold one by one; None where one of them changes the base of numbers."""
        singles = _SingleLines(self._header)
        ends = block.ends
        misses = []
        names = 0
        fixed_before: npt.NDArray[np.int64] = np.cumsum(fixed.found) - fixed.found
        base = self._header.base
        for n, k in enumerate(np.flatnonzero(~fixed.found & filled(block)).tolist()):
            if n % PROGRESS_LINES == 0:
                self._state.unpacked = block.at + int(ends[k])
            item = line(block, k, int(ends[k - 1]) if k else 0, int(ends[k]))
            words = item.text.split()
            if not words:
                continue
            if hms := _HMS.fullmatch(words[0]):
                words[0] = f"{(int(hms[1]) * 60 + int(hms[2])) * 60 + int(hms[3])}.{hms[4]}"
            if not _TIME_WORD.match(words[0]):
                if data := _error_data(item.text):
                    self._error_data = item.number + 1, data
                    singles.kinds[_COMMENT_KIND] += 1
                elif kind := self._header_line(item, singles, k, fixed):
                    singles.kinds[kind] += 1
                else:
                    misses.append((item, "it is no line of an ASC log"))
                if self._header.base != base and fixed.found.any():
                    return None
                continue
            ns = timestamps.from_text(words[0]) if len(words[0]) <= _MAX_TIME_DIGITS else MAX_TIME_NS + 1
            if not -MAX_TIME_NS <= ns <= MAX_TIME_NS:
                misses.append((item, "its time is damaged"))
                continue
            singles.timed.append((k, ns))
            header = self._header
            if header.base == 10 and not header.fd_base and len(words) > 1 and words[1].upper() == "CANFD":
                header = self._header = header._replace(fd_base=asc_fd_base.of_log(self._path, item.number))
                self._state.remark(asc_fd_base.DECIMAL if header.fd_base == 10 else asc_fd_base.HEXADECIMAL)
            if self._state.names:
                named = asc_names.resolved(words, self._state.names, header.base, header.fd_base or 16)
                if named is None:
                    singles.kinds[asc_names.UNKNOWN] += 1
                    continue
                words = named
            try:
                parsed = parse(words, header.base, item, header.fd_base or 16)
            except ValueError as error:
                # a damaged line rarely has all that a frame with a name has
                whole = asc_names.resolved(words, {}, header.base, header.fd_base or 16) is None
                names += isinstance(error, NamedMessage) and whole
                frames = len(singles.frames) + int(fixed_before[k])
                if names > _MAX_NAMES and names >= _SHARE_OF_NAMES * frames and not self._count.read:
                    says = f"{self._path}: line {item.number}: {error}: {_NAMES_REMEDY}"
                    raise SymbolicLogError(says) from None
                misses.append((item, str(error) if isinstance(error, Bad) else "it is no frame"))
                continue
            if parsed is not None:
                if parsed.flags & _ERROR and self._error_data[0] == item.number:
                    parsed = parsed._replace(data=self._error_data[1])
                singles.frames.append((k, parsed))
            elif kind := asc_events.timed(words[1:]):
                singles.kinds[kind] += 1
            else:
                misses.append((item, "it is no line of an ASC log" if item.whole else "the file ends in it"))
        self._count.miss_all(misses, self._state)
        self._count.events += singles.kinds.pop(_EVENT_KIND, 0)
        self._count.others.update(singles.kinds)
        return singles

    def _header_line(self, item: Line, singles: _SingleLines, k: int, fixed: LineColumns) -> str:
        """Process a line without a time; returns its kind, "" where it is none of the format. Raises DamagedLogError."""
        text = item.text.strip()
        exact = text[len(EXACT_START_PREFIX) :] if text.startswith(EXACT_START_PREFIX) else ""
        header, kind = self._header, _HEADER_KIND
        try:
            base_line = asc_base_line.parse(text)
        except ValueError as error:
            raise DamagedLogError(
                f"{self._path}: line {item.number}: the base line {text[:80]!r} cannot be read: {error}; correct it, "
                "as in 'base hex  timestamps absolute', and read the log again"
            ) from None
        if base_line:
            header = header._replace(base=base_line.base, relative=base_line.relative)
            self._header = header
            singles.relative.append((k, header.relative))
            return kind if not _DATE.match(text) else ""
        if exact.isdecimal() and len(exact) <= _MAX_TIME_DIGITS and int(exact) <= MAX_TIME_NS:
            header = header._replace(zeros=Zeros(int(exact)), exact=True)
            kind = _COMMENT_KIND
        elif not (known := asc_events.untimed(text)):
            return ""
        elif match := _DATE.match(text):
            if match[1] and singles.has_time(k, fixed, self._times.begun):
                singles.logs.append((k, item.number))
                singles.relative.append((k, False))
                header = _Header()
            if not header.exact and (at := asc_date.local_ns(match[2], self._state.zone)) is not None:
                zeros = Zeros(at) if match[1] else header.zeros._replace(block=at)
                header = header._replace(zeros=zeros)
        elif match := _EVENT_LINE.match(text):
            if self._state.notes is not None:
                singles.events.append((k, timestamps.from_text(match[1]), match[2], match[3]))
            kind = _EVENT_KIND
        else:
            return known
        self._header = header
        singles.starts.append((k, header.zeros))
        return kind

    def _columns(self, block: Block, fixed: LineColumns, singles: _SingleLines) -> Columns:
        """Merge lines parsed as arrays and one by one, and compute their times."""
        fixed = merged(fixed, singles.frames)
        is_frame = fixed.found
        timed = is_frame.copy()
        ns = fixed.ns
        for k, at in singles.timed:
            timed[k], ns[k] = True, at
        now, far = self._times.absolute(ns, timed, singles)
        damaged = np.flatnonzero(far & is_frame).tolist()
        is_frame[damaged] = False
        ends = block.ends
        items = (line(block, k, int(ends[k - 1]) if k else 0, int(ends[k])) for k in damaged)
        self._count.miss_all(((item, "its time is damaged") for item in items), self._state)
        self._count.took(block.number, np.flatnonzero(is_frame))
        if self._first is None and is_frame.any():
            k = int(is_frame.argmax())
            self._first = int(now[k])
            zeros = singles.zeros_at(k)
            start = zeros.zero(self._times.first)
            if zeros.differ:
                which = "Triggerblock" if start == zeros.block else "date line"
                self._state.remark(f"its date line and its Triggerblock differ: times count from the {which}")
            first_ns = self._first - self._times.shift_at(k)
            self._state.start_ns = None if start is None else start + first_ns
        if self._state.notes is not None:
            self._note(self._state.notes, singles, is_frame)
        self._rows += int(is_frame.sum())
        t = (now - (self._first or 0)).astype(np.float64) * 1e-9
        chunk = Columns(t, fixed.bus, fixed.id, fixed.flags, fixed.length, fixed.data)
        return chunk if is_frame.all() else select(chunk, is_frame)

    def _note(self, notes: list[Note], singles: _SingleLines, is_frame: npt.NDArray[np.bool_]) -> None:
        """Hand out the events, once there is a first frame that their times can count from."""
        before = self._rows + np.cumsum(is_frame) - is_frame
        events = [
            (int(before[k]), ns + self._times.shift_at(k), what, says) for k, ns, what, says in singles.events
        ]
        if self._first is None:
            self._early_events = (self._early_events + events)[:_MAX_EARLY_EVENTS]
            return
        for row, ns, what, says in self._early_events + events:
            notes.append(Note(row, Event((ns - self._first) * 1e-9, what, says)))
        self._early_events = []


def _fast(block: Block, header: _Header) -> LineColumns:
    """The frames of usual form, parsed as arrays; the others' rows are not `found`."""
    if header.base == 16:
        return asc_fixed_columns.read(block)
    decimal = asc_decimal_words.read(block)
    if header.fd_base != 16:
        return decimal
    fd = asc_fixed_columns.read(block, fd_lines(block))
    wide = widened(decimal, fd.data.shape[1])
    columns = zip(map(np.asarray, wide), map(np.asarray, fd), strict=True)
    return LineColumns._make(_replaced(whole, part, fd.found) for whole, part in columns)


def _replaced(
    whole: npt.NDArray[Any], part: npt.NDArray[Any], rows: npt.NDArray[np.bool_]
) -> npt.NDArray[Any]:
    """A column, with some rows taken from another."""
    whole[rows] = part[rows]
    return whole


def _error_data(text: str) -> bytes:
    """The data of the error frame in the next line; empty where the line is no such comment."""
    digits = text[len(ERROR_DATA_PREFIX) :] if text.startswith(ERROR_DATA_PREFIX) else ""
    return bytes.fromhex(digits) if _ERROR_DATA.fullmatch(digits) else b""


class _SingleLines(HeaderLines):
    """Lines that were parsed one by one; `k` is a line's index in its block."""

    def __init__(self, header: _Header):
        super().__init__(header.relative, header.zeros)
        self.timed: list[tuple[int, int]] = []  # k, ns as written in the line
        self.frames: list[tuple[int, Parsed]] = []
        self.events: list[tuple[int, int, str, str]] = []  # k, ns, what, says
        self.kinds: Counter[str] = Counter()  # lines that hold no frame

    def has_time(self, k: int, fixed: LineColumns, begun: bool) -> bool:
        """Whether a line with a time precedes line `k` in its log; `begun`: one does before the block."""
        first = self.logs[-1][0] if self.logs else 0
        if begun and not self.logs:
            return True
        return bool(fixed.found[first:k].any()) or bool(self.timed and self.timed[-1][0] >= first)
