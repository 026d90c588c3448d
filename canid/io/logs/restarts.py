"""A further recording in a log that states no date: its times begin again, and so do those of the ids that came before.

It is set behind the recording before, as far away as parts of a drive of which nothing says how far apart they are. What
is listed bus by bus, or id by id, is one recording: there no id goes back. A step back by the period of a known counter is
its wrap, which `signals.samples.session_clock` judges.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.io.logs.reader_state import ReadState
from canid.signals.samples import clock_wraps
from canid.signals.samples.session_clock import CUT_S, MAX_REORDERING_S, rounded
from canid.values.frame_columns import join, rows
from canid.values.types import Columns

# s; a shorter step back is that of a buffer that came late
_MIN_BACK_S = 1.0
# frames behind a step that show what it is, and the share of them whose id has been later before
_FRAMES, _SHARE = 50, 0.5
# ids that are remembered; a log of more is none of a vehicle, and is left as it is
_MAX_IDS = 1 << 16


class Restarts:
    """Sets further recordings behind the first in the chunks of one reading.

    >>> from canid.values.frame_columns import columns_of
    >>> from canid.values.types import Frame
    >>> drive, state = columns_of([Frame(0.1 * k, 0, 7, bytes([k])) for k in range(100)]), ReadState()
    >>> twice = Restarts(state)
    >>> [round(float(part.t[-1]), 3) for part in (*twice.step(drive), *twice.step(drive), *twice.end())]
    [9.9, 34.8]
    >>> state.remarks[0][:42]
    'a further recording begins at frame 101: i'
    """

    def __init__(self, state: ReadState) -> None:
        """`state`: takes the remarks."""
        self._state = state
        self._row = 0  # frames that were judged so far
        self._before = -np.inf  # s, of the latest frame, as the log has it
        self._offset = 0.0  # s, added to the times of this recording
        self._end = -np.inf  # s, of all recordings so far, set behind one another
        self._ids = np.zeros(0, np.int64)  # of this recording, in order, see `_keys`
        self._latest = np.zeros(0)  # s, of each of them, as the log has it
        self._waiting: Columns | None = None

    def step(self, chunk: Columns, last: bool = False) -> list[Columns]:
        """The frames of a chunk, and those that waited, in parts; some may wait for the next chunk."""
        if self._waiting is not None:
            chunk, self._waiting = join([self._waiting, chunk]), None
        backs = np.flatnonzero(np.diff(chunk.t, prepend=self._before) < -_MIN_BACK_S)
        # behind a further recording's begin no time steps back at once
        lasting = np.diff(backs, append=len(chunk.t) + _FRAMES) >= _FRAMES
        parts, begin = [], 0
        for at in backs[lasting].tolist() if len(self._ids) < _MAX_IDS else []:
            if len(chunk.t) - at < _FRAMES and not last:
                self._waiting = rows(chunk, at, len(chunk.t))
                chunk = rows(chunk, 0, at)
                break
            parts.append(self._set(rows(chunk, begin, at)))
            self._judge(rows(chunk, at, at + _FRAMES))
            begin = at
        parts.append(self._set(rows(chunk, begin, len(chunk.t))))
        return [part for part in parts if part.t.size]

    def end(self) -> list[Columns]:
        """The frames that still wait."""
        waiting, self._waiting = self._waiting, None
        return [] if waiting is None else self.step(waiting, last=True)

    def _judge(self, behind: Columns) -> None:
        """Whether the frames behind a step back are of a further recording."""
        keys = _keys(behind)
        at = np.minimum(self._ids.searchsorted(keys), len(self._ids) - 1)
        known = np.where(self._ids[at] == keys, self._latest[at], -np.inf)
        newest, first = float(self._latest.max()), float(behind.t[0])
        if (known > behind.t + _MIN_BACK_S).mean() < _SHARE:
            return
        if clock_wraps.wrap_of(newest - first, MAX_REORDERING_S) is not None:
            return
        self._offset = self._end + CUT_S - float(behind.t.min())
        self._ids, self._latest = self._ids[:0], self._latest[:0]
        self._state.remark(
            f"a further recording begins at frame {self._row + 1:,}: its times go from {newest:.6g} s back to {first:.6g} "
            f"s, and the log states no date: it is set {CUT_S:g} s behind the one before"
        )

    def _set(self, part: Columns) -> Columns:
        """The frames of one recording at their times."""
        if not part.t.size:
            return part
        self._row += len(part.t)
        self._before = float(part.t[-1])
        if len(self._ids) < _MAX_IDS:
            self._ids, which = np.unique(np.concatenate([self._ids, _keys(part)]), return_inverse=True)
            latest = np.full(len(self._ids), -np.inf)
            np.maximum.at(latest, which, np.concatenate([self._latest, part.t]))
            self._latest = latest
        if self._offset:
            part = part._replace(t=rounded(part.t + self._offset, abs(self._offset)))
        self._end = max(self._end, float(part.t.max()))
        return part


def _keys(chunk: Columns) -> npt.NDArray[np.int64]:
    """One number for the bus and the id of each frame."""
    return chunk.bus.astype(np.int64) << 32 | chunk.id.astype(np.int64)
