"""Time in which a log has frames: pauses of the whole log are in its duration, and in no rate."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.signals.samples.sampling_grid import MAX_PAUSE_S
from canid.values.types import NAN, Array


class RecordedTime(NamedTuple):
    """When frames came, of whatever id."""

    first: float = NAN  # s
    last: float = NAN  # s
    pauses: tuple[tuple[float, float], ...] = ()  # s, (end, length) of those without any frame

    def after(self, t: Array) -> RecordedTime:
        """With some more frames.

        Args:
            t: (n,) s, in the order of the log.

        Example:
            >>> RecordedTime().after(np.array([0.0, 1.0])).after(np.array([61.0]))
            RecordedTime(first=0.0, last=61.0, pauses=((61.0, 60.0),))
        """
        if not t.size:
            return self
        latest = np.fmax.accumulate(np.concatenate([[self.last], t]))
        steps = np.diff(latest)
        at = np.flatnonzero(steps > MAX_PAUSE_S)
        pauses = zip(latest[at + 1].tolist(), steps[at].tolist(), strict=True)
        first = float(np.fmin(self.first, t.min()))
        return RecordedTime(first, float(latest[-1]), (*self.pauses, *pauses))

    @property
    def duration(self) -> float:
        """From the first frame to the last one, s; 0: none came."""
        return self.last - self.first if self.last >= self.first else 0.0

    @property
    def paused(self) -> float:
        """Those of it without any frame, s."""
        return math.fsum(length for _, length in self.pauses)

    def without_pauses(self, t: Array) -> Array:
        """Times on a clock that stands still in each pause.

        Args:
            t: (n,) s.

        Example:
            >>> RecordedTime(0.0, 61.0, ((61.0, 60.0),)).without_pauses(np.array([0.0, 1.0, 61.0, 62.0]))
            array([0., 1., 1., 2.])
        """
        if not self.pauses:
            return t
        ends, lengths = np.array(self.pauses).T
        before = np.concatenate([[0.0], np.cumsum(lengths)])
        return np.asarray(t - before[np.searchsorted(ends, t, side="right")])

    def rate(self, n: float) -> float:
        """How often a second something came, 1/s; NaN where it came in no time.

        Args:
            n: how often it came.

        Example:
            >>> RecordedTime(0.0, 62.0, ((61.0, 60.0),)).rate(20)
            10.0
        """
        # of a log whose frames are all so far apart nothing is a pause
        seconds = self.duration - self.paused or self.duration
        return n / seconds if seconds > 0.0 else NAN

    def rate_of(self, t: Array) -> float:
        """Readings a second, from the first to the last of them, 1/s; NaN of one.

        Args:
            t: (n,) s, ascending.

        Example:
            >>> RecordedTime(0.0, 61.1, ((61.0, 60.0),)).rate_of(np.array([0.0, 0.5, 1.0, 61.0, 61.5]))
            2.6666666666666665
        """
        if len(t) < 2:
            return NAN
        kept = self.without_pauses(t[[0, -1]])
        seconds = float(kept[1] - kept[0]) or float(t[-1] - t[0])
        return (len(t) - 1) / seconds if seconds > 0.0 else NAN
