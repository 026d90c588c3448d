"""The traces of drives that a process has read last: the drives of a driver are those of the car, and read once for both."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

from canid.values.types import Trace

# s of driving that are kept: 7 MB an hour
MAX_KEPT_S = 4 * 3600.0


class RecentTraces:
    """The most recently used traces, up to so much driving.

    Args:
        max_s: s of driving.

    Example:
        >>> import canid
        >>> recent = RecentTraces(max_s=1000.0)
        >>> read = lambda: canid.read_trace("replay_logs/following_lost_lead.blf", "generic")
        >>> recent.trace("a", read) is recent.trace("a", read)
        True
    """

    def __init__(self, max_s: float = MAX_KEPT_S) -> None:
        self._max_s = max_s
        self._kept: OrderedDict[str, Trace] = OrderedDict()

    def trace(self, identity: str, read: Callable[[], Trace]) -> Trace:
        """A trace that is kept, or else is read.

        Args:
            identity: of the log's bytes, and of how they are decoded.
            read: reads it.
        """
        trace = self._kept[identity] if identity in self._kept else read()
        self._kept[identity] = trace
        self._kept.move_to_end(identity)
        while len(self._kept) > 1 and sum(map(_seconds, self._kept.values())) > self._max_s:
            self._kept.popitem(last=False)
        return trace


def _seconds(trace: Trace) -> float:
    return trace.t.size * trace.dt
