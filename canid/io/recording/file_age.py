"""The age of a file of an earlier session: counted only between clocks that confirm each other.

The wall clock of a computer in a vehicle may be wrong by years: it has no battery, or is not set yet. So a time span is
believed where all clocks that were running at both ends agree on it: within one boot those of the system (which no
setting of the time changes) and the wall clock; across boots the wall clock where the kernel says at both ends that it is
synchronised (adjtimex(2), STA_UNSYNC).
"""

from __future__ import annotations

import ctypes
import sys
import time
from pathlib import Path
from typing import NamedTuple

# Clocks agree on a time span to this many s and this share: a wall clock that is corrected by minutes after the start, or
# drifts, is not wrong; one that is set by hours is, for spans of less than four days.
_TOLERANCE_S, _TOLERANCE_SHARE = 120.0, 0.01
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_UPTIME = Path("/proc/uptime")
# adjtimex(2): room for struct timex (208 bytes on 64-bit Linux), and what it returns where the clock is not synchronised
_TIMEX_BYTES, _TIME_ERROR = 512, 5


class Clocks(NamedTuple):
    """Readings of all clocks at one instant."""

    boot: str = ""  # identifies the boot; "": not known
    wall: float = 0.0  # s since 1970
    uptime: float = -1.0  # s since the boot, of the kernel's file; -1: not known
    boottime: float = -1.0  # s since the boot, of the clock
    synchronised: bool = False  # the kernel says that the wall clock is


UNKNOWN = Clocks()


def read_clocks() -> Clocks:
    """Read all clocks now.

    >>> elapsed(read_clocks(), read_clocks()) in (None, 0.0) or elapsed(read_clocks(), read_clocks()) < 1.0
    True
    """
    boottime = time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else -1.0
    uptime = _first_word(_UPTIME)
    return Clocks(
        _first_word(_BOOT_ID), time.time(), float(uptime) if uptime else -1.0, boottime, _is_synchronised()
    )


def elapsed(since: Clocks, now: Clocks) -> float | None:
    """Seconds between two readings; None where the clocks do not confirm each other.

    >>> now = Clocks("a", 1e9, 100.0, 100.0)
    >>> elapsed(now, Clocks("a", 1e9 + 50.0, 150.0, 150.0))
    50.0
    >>> elapsed(now, Clocks("a", 1e9 + 691_200.0, 150.0, 150.0)) is None  # the wall clock was set on by 8 days
    True
    >>> elapsed(now, Clocks("b", 1e9 + 50.0, 10.0, 10.0)) is None  # another boot
    True
    """
    wall = now.wall - since.wall
    if since.boot and since.boot == now.boot and since.uptime >= 0.0 and now.uptime >= 0.0:
        spans = [wall, now.uptime - since.uptime]
        if since.boottime >= 0.0 and now.boottime >= 0.0:
            spans.append(now.boottime - since.boottime)
        least, most = min(spans), max(spans)
        return least if least >= 0.0 and most <= least * (1 + _TOLERANCE_SHARE) + _TOLERANCE_S else None
    confirmed = since.synchronised and now.synchronised and wall >= 0.0
    return wall if confirmed and since.boot and now.boot else None


def _first_word(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").split()[0]
    except (OSError, ValueError, IndexError):
        return ""


def _is_synchronised() -> bool:
    """Whether the kernel says that something keeps the wall clock right: NTP, PTP or a receiver of satellites."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        state: int = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES))
    except (OSError, AttributeError):
        return False
    return 0 <= state < _TIME_ERROR
