"""Both halves of a drive."""

from __future__ import annotations

import numpy as np

from canid.signals.samples.trace_assembly import part
from canid.signals.signal_checks.drive_time import usable
from canid.values.types import Trace


def halves(trace: Trace) -> tuple[Trace, Trace]:
    """Cut a drive where half of its usable time is over.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> first, second = halves(drive)
        >>> len(first.t) + len(second.t) == len(drive.t), abs(int(usable(first).sum()) - int(usable(second).sum())) < 2
        (True, True)
    """
    used = np.cumsum(usable(trace))
    middle = int(np.searchsorted(used, 0.5 * used[-1])) + 1 if len(used) else 0
    return part(trace, slice(0, middle)), part(trace, slice(middle, None))
