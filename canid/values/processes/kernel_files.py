"""Regular files that are none: those of /proc, whose reading can wait for an event although nobody asked for that."""

from __future__ import annotations

import os


def of_the_kernel(status: os.stat_result) -> bool:
    """Whether a file is one of /proc.

    Example:
        >>> of_the_kernel(os.stat(os.sep))
        False
    """
    try:
        return status.st_dev == os.stat("/proc/self").st_dev
    except OSError:
        return False
