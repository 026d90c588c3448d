"""The running time of a recording: stamps without the steps back of their clocks, and without the offsets between them.

A file that is to last a minute lasts that whatever the buses' clocks say.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

# ns that a stamp may be before the newest one: frames of several buses, and those of a busy machine, do not come in the
# order of their stamps. What is further back is a step of its clock, or the clock of another bus.
MAX_BACK_NS = 1_000_000_000

_Ns = npt.NDArray[np.int64]


class RunningTime:
    """Never goes back.

    A step forward is believed, since it cannot be distinguished from a bus that was silent; the first stamp of another bus
    is not, since its clock may be ahead.

    >>> time = RunningTime()
    >>> time.of(np.array([0, 10]) * 10**9, np.zeros(2, np.uint16)).tolist()
    [0, 10000000000]
    >>> time.of(np.array([4, 5]) * 10**9, np.zeros(2, np.uint16)).tolist()  # set back by some 6 s
    [10000000000, 11000000000]
    """

    def __init__(self) -> None:
        self._offsets: dict[int, int] = {}  # bus -> ns from its stamps to the running time
        self._known: set[int] = set()  # buses that have given a frame
        self.latest: int | None = None  # ns

    def of(self, ns: _Ns, bus: npt.NDArray[np.uint16]) -> _Ns:
        """The running time of frames in the order in which they came.

        Args:
            ns: (n,) session time.
            bus: (n,) which clock stamped each.

        Returns:
            (n,) ns, ascending.
        """
        if not ns.size:
            return ns
        latest = int(ns[0]) if self.latest is None else self.latest
        times = ns
        if self._offsets:
            times = ns + np.array([self._offsets.get(each, 0) for each in range(int(bus.max()) + 1)])[bus]
        highest = np.maximum(np.maximum.accumulate(times), latest)
        new = set(np.unique(bus).tolist()) - self._known
        if new or (times < highest - MAX_BACK_NS).any():
            highest = self._stepped(ns.tolist(), bus.tolist(), latest)
        self.latest = int(highest[-1])
        return highest

    @property
    def furthest_behind(self) -> int:
        """How far behind the running time the clock of some bus may be, ns."""
        return max(self._offsets.values(), default=0)

    def _stepped(self, stamps: list[int], buses: list[int], latest: int) -> _Ns:
        """The same frame by frame, where a clock is behind the others or was set back."""
        out = []
        for ns, bus in zip(stamps, buses, strict=True):
            if bus not in self._known:
                self._known.add(bus)
                if ns > latest + MAX_BACK_NS:
                    self._offsets[bus] = latest - ns
            at = ns + self._offsets.get(bus, 0)
            if at < latest - MAX_BACK_NS:
                self._offsets[bus], at = latest - ns, latest
            latest = max(latest, at)
            out.append(latest)
        return np.array(out, np.int64)
