"""What this machine must have for the trials, found out without sending a packet or mounting anything."""

from __future__ import annotations

import os
import socket

from benchmarks.reliability import fuse
from tests.fixtures.traffic import GROUP


def loopback_alone() -> str:
    """Why there is no bus between processes that stays on this machine; "" where there is one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((GROUP, 9))  # finds the route, and sends nothing
        except OSError:
            return "no route for multicast"
        address = probe.getsockname()[0]
    if address == "0.0.0.0" or address.startswith("127."):
        return ""
    return "multicast would leave this machine: `make test` runs this in a network namespace of its own"


def mounting() -> str:
    """Why no file system can be mounted; "" where it can."""
    return "" if fuse.available() else "needs root and /dev/fuse, to mount file systems that fail"


def root() -> str:
    """Why no tmpfs can be mounted; "" where it can."""
    return "" if hasattr(os, "geteuid") and os.geteuid() == 0 else "needs root, to mount a small tmpfs"
