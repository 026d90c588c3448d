"""The most memory that this process has held since a log was begun."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

from canid.values.processes import limits


def restart() -> None:
    """Let the peak begin anew; where the system cannot, it stays that of the process's life."""
    with suppress(OSError):
        # proc(5): 5 resets the peak resident set size
        os.write(_setting(), b"5")


@cache
def _setting() -> int:
    """Opened once: a process that has given up its rights to write keeps it."""
    return limits.opened_setting("/proc/self/clear_refs")


def peak_bytes() -> int | None:
    """Peak resident set size; None: the system does not say.

    Example:
        >>> (peak_bytes() or 0) > 1_000_000
        True
    """
    with suppress(OSError, ValueError, IndexError):
        for row in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if row.startswith("VmHWM:"):
                return 1024 * int(row.split()[1])
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # macOS states bytes, others kilobytes
    return peak if sys.platform == "darwin" else 1024 * peak
