"""Exact copies of frames in one log: of two loggers that were merged, or of a log that was appended twice.

A copy has the time, the id and the data of another frame. A few may be so by chance: an interface stamps a burst with one
time, and static data are alike. So copies are left out only in a row of many frames that are all there twice or were there
before, and whose data change.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.frame_columns import join, rows, select
from canid.values.types import Array, Columns

# frames in a row that are shown to be there twice; chance makes none of so many
_IN_A_ROW = 50
# s; frames that are out of order by less are those of two buses
_STEP_BACK_S = 0.1
# share of the frames with the time of the one before, from which on a chunk is searched, however short it is
_SHARE_TWICE = 0.4
# marks of earlier frames that are kept (16 MB); of a longer log those of one frame in 16, in 256, ...
_MAX_MARKS, _FEWER_BITS = 1 << 21, 4
_FACTORS = [np.uint64(k) for k in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)]
_Marks = npt.NDArray[np.uint64]
_Bools = npt.NDArray[np.bool_]


def _content(chunk: Columns) -> _Marks:
    """A number for each frame that is the same where all but the time is."""
    kind = chunk.flags.astype(np.uint64) << np.uint64(8) | chunk.length
    kind |= chunk.id.astype(np.uint64) << np.uint64(32) | chunk.bus.astype(np.uint64) << np.uint64(16)
    mark = kind * _FACTORS[1]
    words = np.ascontiguousarray(chunk.data).view(np.uint64)
    for k in range(words.shape[1]):  # 0 beyond the length, however wide the chunk is
        word = words[:, k] * (_FACTORS[2] + np.uint64(2 * k))
        mark += word ^ word >> np.uint64(31)
    return mark


def marks(chunk: Columns) -> _Marks:
    """A number of 64 bits for each frame: equal for copies.

    >>> from canid.values.frame_columns import columns_of
    >>> from canid.values.types import Frame
    >>> one, two = Frame(1.0, 0, 7, b"a"), Frame(1.0, 0, 7, bytes(9))
    >>> marks(columns_of([one])) == marks(columns_of([one, two]))
    array([ True, False])
    """
    mark = _content(chunk) ^ np.ascontiguousarray(chunk.t).view(np.uint64) * _FACTORS[0]
    mark ^= mark >> np.uint64(29)
    mark *= _FACTORS[1]
    mark ^= mark >> np.uint64(32)
    return mark


class _Part(NamedTuple):
    """Earlier frames."""

    begin: float  # s
    end: float  # s
    marks: _Marks


class Copies:
    """Leaves copies out of the chunks of one reading.

    >>> from canid.values.frame_columns import columns_of
    >>> from canid.values.types import Frame
    >>> drive, copies = columns_of([Frame(0.01 * k, 0, 7, bytes([k])) for k in range(100)]), Copies()
    >>> len(copies.step(drive).t), len(copies.step(drive, last=True).t), copies.count
    (100, 0, 100)
    """

    def __init__(self) -> None:
        """Nothing was read."""
        self.count = 0  # copies so far
        self.rows = 0  # frames that were judged so far
        self.left_out = np.zeros(0, np.int64)  # those that `step` has just left out: which of all frames
        self._parts: list[_Part] = []
        self._size = 0  # marks that are kept
        self._thinned = np.uint64(0)  # bits that are 0 in the marks that are kept
        self._latest = -np.inf  # s, of all frames so far
        self._in_row = False  # the latest frame is one of a row of copies
        self._waiting: Columns | None = None  # the last frames, which may begin a row

    def step(self, chunk: Columns, last: bool = False) -> Columns:
        """The frames of a chunk, and those that waited, without copies; some of them may wait for the next chunk.

        Args:
            chunk: the next one.
            last: none waits.
        """
        if self._waiting is not None:
            chunk, self._waiting = join([self._waiting, chunk]), None
        self.left_out = np.zeros(0, np.int64)
        if not chunk.t.size:
            return chunk
        mark, t = marks(chunk), chunk.t
        before = np.maximum.accumulate(np.concatenate([[self._latest], t]))[:-1]
        again = (t <= before).sum() >= min(_IN_A_ROW, _SHARE_TWICE * len(t)) and t.min() < t.max()
        if again or self._in_row or (before - t > _STEP_BACK_S).any():
            return self._judged(chunk, mark, last)
        return self._kept(chunk, mark)

    def end(self) -> list[Columns]:
        """The frames that still wait."""
        waiting, self._waiting = self._waiting, None
        return [] if waiting is None else [self.step(waiting, last=True)]

    def _kept(self, chunk: Columns, mark: _Marks) -> Columns:
        """Keep the marks of frames, and count them."""
        self.rows += len(chunk.t)
        if chunk.t.size:
            self._latest = max(self._latest, float(chunk.t.max()))
            self._keep(chunk.t, mark)
        return chunk

    def _judged(self, chunk: Columns, mark: _Marks, last: bool) -> Columns:
        """Leave copies out."""
        later = np.flatnonzero(chunk.t != chunk.t[-1])
        end = int(later[-1]) + 1 if later.size else 0
        if not last and len(chunk.t) - end < _IN_A_ROW:  # the copy of a last one may still come
            self._waiting = rows(chunk, end, len(chunk.t))
            chunk, mark = rows(chunk, 0, end), mark[:end]
        copy, twice, known = self._compared(chunk.t, mark)
        at = np.flatnonzero(known)  # rows that can be judged
        edges = np.flatnonzero(np.diff(np.concatenate([[False], twice[at], [False]]))).reshape(-1, 2)
        in_row = np.zeros(len(at), bool)
        end = len(chunk.t)
        for begin, stop in edges.tolist():
            goes_on = self._in_row and begin == 0
            if goes_on or (stop - begin >= _IN_A_ROW and _changes(select(chunk, at[begin:stop]))):
                in_row[begin:stop] = True
            elif stop == len(at) and stop - begin < _IN_A_ROW and not last:
                end = int(at[begin - 1]) + 1 if begin else 0
                waiting = [rows(chunk, end, len(chunk.t)), *([self._waiting] if self._waiting else [])]
                self._waiting = join(waiting)
        # a frame that cannot be judged is as one next to it
        states = np.concatenate([[self._in_row], in_row])
        which = np.arange(end)
        of_row = states[np.searchsorted(at, which, "right")]
        of_row |= np.append(states, False)[np.searchsorted(at, which, "left") + 1]
        self._in_row = bool(of_row[-1]) if end else False
        gone = of_row & copy[:end]
        kept = np.flatnonzero(~gone)
        self.left_out = self.rows + np.flatnonzero(gone)
        self.count, self.rows = self.count + len(self.left_out), self.rows + len(self.left_out)
        return self._kept(select(chunk, kept), mark[:end][kept])

    def _compared(self, t: Array, mark: _Marks) -> tuple[_Bools, _Bools, _Bools]:
        """Which frames are copies of earlier ones, which are there twice, and of which that is known."""
        order = np.argsort(mark, kind="stable")
        same = np.diff(mark[order]) == 0
        copy, twice = np.zeros(len(t), bool), np.zeros(len(t), bool)
        copy[order[1:][same]] = True
        twice[order[:-1][same]] = True
        old = np.flatnonzero(t <= self._latest)
        if old.size:
            begin, end = t[old].min(), t[old].max()
            for part in self._parts:
                if part.begin <= end and part.end >= begin:
                    copy[old] |= np.isin(mark[old], part.marks)
        known = copy | ((mark & self._thinned) == 0) | (t > self._latest)
        return copy | ~known, twice | copy, known

    def _keep(self, t: Array, mark: _Marks) -> None:
        kept = mark[(mark & self._thinned) == 0] if self._thinned else mark
        self._parts.append(_Part(float(t.min()), float(t.max()), kept))
        self._size += len(kept)
        if self._size > _MAX_MARKS:
            self._thinned = self._thinned << np.uint64(_FEWER_BITS) | np.uint64((1 << _FEWER_BITS) - 1)
            self._parts = [
                part._replace(marks=part.marks[(part.marks & self._thinned) == 0]) for part in self._parts
            ]
            self._size = sum(len(part.marks) for part in self._parts)


def _changes(chunk: Columns) -> bool:
    """Whether the data of an id change: of static data copies and bursts look alike."""
    return len(np.unique(_content(chunk))) > len(np.unique(chunk.id))
