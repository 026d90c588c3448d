"""The times of an .asc: relative ones summed up, and those of joined logs on one axis.

A second `date` line behind lines with times begins a second log, as of files that were joined by cat or copy. Its times
count from its own zero: they are shifted by the difference of the two dates or, where a date is not stated, to the last
time of the log before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs import joined_logs
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import MAX_TIME_NS
from canid.values.timestamps import NS_PER_S

Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


class Zeros(NamedTuple):
    """Dates from which the times of a log may count, epoch ns; None: not stated."""

    head: int | None = None  # its `date` line
    block: int | None = None  # of `Begin Triggerblock`

    def zero(self, first: int) -> int | None:
        """From which of them: a block that begins later than the log has times from either, as its first time shows.

        Args:
            first: ns, the first time as it is written.

        Example:
            >>> hour = 3600 * 10**9
            >>> both = Zeros(0, hour)
            >>> both.zero(0) == hour, both.zero(-10**9) == hour, both.zero(hour + 5)
            (True, True, 0)
        """
        if self.head is None or self.block is None:
            return self.block if self.head is None else self.head
        return self.head if self.differ and 2 * first > self.block - self.head > 0 else self.block

    @property
    def differ(self) -> bool:
        """Whether both are stated, and are not the same second."""
        return self.head is not None and self.block is not None and abs(self.block - self.head) >= NS_PER_S


class HeaderLines:
    """Header lines of a block; `k` is a line's index in it."""

    def __init__(self, relative: bool, zeros: Zeros):
        """`relative`, `zeros`: as the lines before the block say."""
        # from which line on times are relative, and which dates apply
        self.relative = [(0, relative)]
        self.starts = [(-1, zeros)]
        self.logs: list[tuple[int, int]] = []  # where a further log begins: k, number of the line

    def zeros_at(self, k: int) -> Zeros:
        """The dates that apply to line `k`."""
        return [zeros for at, zeros in self.starts if at <= k][-1]


class LogTimes:
    """The times so far."""

    def __init__(self, state: ReadState):
        """`state`: takes the remarks about joined logs."""
        self.begun = False  # this log had a line with a time
        self.first = 0  # ns, of that line, as written
        self._state = state
        self._axis = joined_logs.Axis(state)
        self._now = 0  # ns, of the latest line with a time, since this log's zero
        self._number = 0  # of the line in which this log begins
        self._shift: int | None = 0  # of this log's times; None: not known before its first time
        self._shifts: list[tuple[int, int]] = []  # of the latest block: from line k on

    def absolute(self, ns: Ints, timed: Bools, lines: HeaderLines) -> tuple[Ints, Bools]:
        """The time of each line since the first log's zero, and the frames whose time is none that can be.

        Args:
            ns: (n,) as written.
            timed: (n,) lines with a time.
            lines: the header lines between them.
        """
        far = np.zeros(len(ns), bool)
        self._shifts = []
        borders = [0, *(k for k, _ in lines.logs), len(ns)]
        numbers = [-1, *(number for _, number in lines.logs)]
        for number, a, b in zip(numbers, borders[:-1], borders[1:], strict=True):
            if number >= 0:
                self._now, self._number, self._shift, self.begun = 0, number, None, False
            ns, far[a:b] = self._summed(ns, timed, lines, a, b)
            shift = self._shifted(ns, timed, lines, a, b)
            self._shifts.append((a, shift))
            if shift:
                ns[a:b] += np.where(timed[a:b], shift, 0)
                far[a:b] |= timed[a:b] & (np.abs(ns[a:b]) > MAX_TIME_NS)
        return ns, far

    def shift_at(self, k: int) -> int:
        """What was added to the time of line `k` of the latest block; a log without a time yet has none."""
        return [shift for at, shift in self._shifts if at <= k][-1]

    def _shifted(self, ns: Ints, timed: Bools, lines: HeaderLines, a: int, b: int) -> int:
        """What is added to the times of one log's lines."""
        there = np.flatnonzero(timed[a:b])
        if there.size:
            if not self.begun:
                self.first = int(ns[a + int(there[0])])
                start = lines.zeros_at(a + int(there[0])).zero(self.first)
                self._shift = self._axis.begin(start, f"line {self._number}" if self._shift is None else "")
            self.begun = True
            self._now = int(ns[a + int(there[-1])])
            self._axis.last = self._now + (self._shift or 0)
        return self._shift or 0

    def _summed(self, ns: Ints, timed: Bools, lines: HeaderLines, a: int, b: int) -> tuple[Ints, Bools]:
        """Sum up relative times of the lines from `a` to `b`."""
        far = np.zeros(b - a, bool)
        states = [(max(k, a), relative) for k, relative in lines.relative if k < b]
        states = [
            state for n, state in enumerate(states) if n + 1 == len(states) or states[n + 1][0] > state[0]
        ]
        if not any(relative for _, relative in states):
            return ns, far
        ns = np.where(timed, ns, 0)
        now = self._now
        borders = [k for k, _ in states] + [b]
        for (_, relative), first, last in zip(states, borders[:-1], borders[1:], strict=True):
            if relative and last > first:
                if now + float(ns[first:last].sum(dtype=np.float64)) > MAX_TIME_NS:
                    far[first - a : last - a] = _sum_singly(ns[first:last], now)
                else:
                    ns[first:last] = now + np.cumsum(ns[first:last])
                now = int(ns[last - 1])
            elif timed[first:last].any():
                now = int(ns[first + np.flatnonzero(timed[first:last])[-1]])
        return ns, far


def _sum_singly(ns: Ints, now: int) -> Bools:
    """Sum up in place; a step beyond what 64 bits hold is not taken: it is a damaged time."""
    far = np.zeros(len(ns), bool)
    for k, step in enumerate(ns.tolist()):
        far[k] = now + step > MAX_TIME_NS
        now += 0 if far[k] else step
        ns[k] = now
    return far
