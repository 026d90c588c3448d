"""Frames that the kernel dropped between a network device and its sockets, as the device counts them.

A received frame waits in a queue of the processor (net.core.netdev_max_backlog, 1,000 frames of all devices) until the
kernel gives it to the sockets. Where that queue overflows, or memory for a frame is lacking, no socket's count of drops
says so: only the device's own count does (linux/if_link.h: rx_dropped, rx_missed_errors).
"""

from __future__ import annotations

import re
from pathlib import Path

# of the network namespace of this process; reading it takes no lock that a slow driver may hold, unlike netlink's queries
COUNTERS = Path("/proc/net/dev")
# the fourth number of a line: proc_pid_net(5)
_DROPPED = 3


def of_device(name: str) -> int | None:
    """The device's count since it was created; None: there is no such device, or no such file.

    >>> of_device("lo") is None or of_device("lo") >= 0
    True
    """
    try:
        text = COUNTERS.read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    line = re.search(rf"^\s*{re.escape(name)}:(.*)$", text, re.MULTILINE)
    if line is None:
        return None
    numbers = line[1].split()
    return int(numbers[_DROPPED]) if len(numbers) > _DROPPED and numbers[_DROPPED].isdigit() else None


class DeviceDrops:
    """The growth of a device's count since this object was made."""

    def __init__(self, name: str) -> None:
        self._last = of_device(name)
        self._grown = 0

    def count(self, name: str) -> int:
        """Frames dropped until now; `name`: the device's present one, "" where it is gone."""
        now = of_device(name) if name else None
        if now is not None:
            # a count that is smaller than before is that of another device, or of a driver that was loaded again
            if self._last is not None and now > self._last:
                self._grown += now - self._last
            self._last = now
        return self._grown
