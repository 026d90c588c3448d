"""Which process the system ends first where memory runs out: every child before the process that started it.

A recording must outlive what only explains it: a child that is ended is started again, or its work is done later.
"""

from __future__ import annotations

from contextlib import suppress

from canid.values.processes import limits

# The most that proc(5) has. The kernel compares memory held + value / 1000 of all memory: with 500, of 130 MB, a parser of
# 30 MB counts as 95 MB, and a recorder that holds 110 MB is ended first.
OOM_SCORE = 1000


def end_before_parent(pid: int) -> None:
    """Where memory runs out, the system shall end this child, and what it starts, before any process with a lower value.

    This process keeps its own value. Where the system has no such setting, nothing happens.

    Example:
        >>> import subprocess, sys
        >>> child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
        >>> end_before_parent(child.pid)
        >>> _ = child.communicate()
    """
    with suppress(OSError):
        limits.kernel_setting(f"/proc/{pid}/oom_score_adj", str(OOM_SCORE))
