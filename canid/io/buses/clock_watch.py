"""Detection of steps of the clock that stamps a bus's frames."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

# ns; smaller steps forward cannot be distinguished from delays on a busy machine; smaller ones back change the order of
# stamps, which `order` counts
MIN_STEP_NS = 500_000_000


class ClockWatch:
    """Compares time stamps with the times of arrival on the monotonic clock.

    A reader that lags makes stamps late, never early: so a step forward is one beyond the largest lead so far, and a
    step back is a stamp before the previous one.

    >>> watch = ClockWatch()
    >>> watch.update(10**18, 5.0), watch.update(10**18 + 10**9, 6.0)
    (0.0, 0.0)
    >>> round(watch.update(10**18 + 61 * 10**9, 6.0), 3)
    60.0
    """

    def __init__(self) -> None:
        """Begin without a stamp."""
        self._last = 0  # ns
        self._ahead: float | None = None  # ns, the largest lead of a stamp before its arrival
        self._back_count, self._most_back = 0, 0  # frames, ns

    def update(self, ns: int, at: float) -> float:
        """Process the stamp of a frame that arrived at `at` s; returns the step in s, 0 where there was none."""
        ahead = ns - at * 1e9
        before, largest = self._last, self._ahead
        self._last = ns
        if largest is None or largest < ahead <= largest + MIN_STEP_NS:
            self._ahead = ahead
        elif ns < before - MIN_STEP_NS:
            self._ahead = ahead
            return (ns - before) * 1e-9
        elif ahead > largest:
            self._ahead = ahead
            return (ahead - largest) * 1e-9
        return 0.0

    def update_many(self, ns: npt.NDArray[np.int64], at: float) -> list[float]:
        """Process stamps of frames that were received together at `at` s; returns the steps in s."""
        self._count_back(ns)
        largest, newest = self._ahead, float(ns.max()) - at * 1e9
        back = int(ns[0]) < self._last - MIN_STEP_NS or bool((ns[1:] < ns[:-1] - MIN_STEP_NS).any())
        if largest is None or newest > largest + MIN_STEP_NS or back:
            return [step for each in ns.tolist() if (step := self.update(each, at))]
        self._last, self._ahead = int(ns[-1]), max(largest, newest)
        return []

    def _count_back(self, ns: npt.NDArray[np.int64]) -> None:
        back = np.diff(ns, prepend=max(self._last, 0) if self._ahead is not None else ns[0])
        small = back[(back < 0) & (back >= -MIN_STEP_NS)]
        self._back_count += small.size
        self._most_back = max(self._most_back, -int(small.min(initial=0)))

    def order(self) -> tuple[int, float]:
        """Frames since the last call with a stamp before that of the frame before, and by how many s at most.

        Steps of more than half a second are not among them.

        >>> watch = ClockWatch()
        >>> watch.update_many(np.array([10**18, 10**18 - 3_000_000, 10**18]), 5.0), watch.order(), watch.order()
        ([], (1, 0.003), (0, 0.0))
        """
        reversals = self._back_count, self._most_back * 1e-9
        self._back_count = self._most_back = 0
        return reversals

    @property
    def lead_ns(self) -> float | None:
        """The largest lead of a stamp before its arrival so far: of the frame that was delayed least; None: unknown."""
        return self._ahead

    def forget(self) -> None:
        """The bus was opened again: its clock may count from another zero."""
        self._ahead = None
