"""Limits of a process: memory, processor time, and which process the system ends first where memory runs out."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress

_ALWAYS = getattr(os, "O_CLOEXEC", 0)


def limit_data(memory_bytes: int | None) -> None:
    """Let this process allocate so many bytes; more is a MemoryError. None: as much as the system lets it.

    Where the system has no such limit, nothing happens.
    """
    with suppress(ImportError, OSError, ValueError):
        import resource

        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        soft = hard if memory_bytes is None else memory_bytes
        if hard != resource.RLIM_INFINITY:
            soft = min(soft, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def limit_more_data(more_bytes: int) -> None:
    """Let this process allocate so many bytes beyond what it has; nothing happens where the system does not say what."""
    data = _memory_bytes(5)
    if data:
        limit_data(data + more_bytes)


def limit_data_of(pid: int, memory_bytes: int) -> None:
    """Let another process allocate so many bytes, for good; where the system cannot, nothing happens."""
    # AttributeError: not Linux; OSError: it is gone already
    with suppress(ImportError, AttributeError, OSError):
        import resource

        resource.prlimit(pid, resource.RLIMIT_DATA, (memory_bytes, memory_bytes))


def limit_cpu(seconds: float) -> float:
    """End this process by SIGPROF after so many CPU s; 0: no limit. Returns what was left of the limit before, in s."""
    if not hasattr(signal, "ITIMER_PROF"):
        return 0.0
    return signal.setitimer(signal.ITIMER_PROF, seconds)[0]


def cpu_used_s() -> float:
    """CPU time that this process has taken so far, in s."""
    return time.process_time()


def resident_bytes() -> int:
    """Memory that this process holds; 0: the system does not say."""
    return _memory_bytes(1)


def ordinary_priority(pid: int) -> None:
    """Take from a child the raised priority that it has inherited."""
    with suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, pid, max(os.getpriority(os.PRIO_PROCESS, pid), 0))


def lowest_priority(pid: int) -> None:
    """Let a child of a session of its own run where no other process wants the processor."""
    with suppress(AttributeError, OSError):
        os.setpriority(os.PRIO_PROCESS, pid, 19)
        # Linux divides the cores among sessions first (sched(7), autogroup)
        kernel_setting(f"/proc/{pid}/autogroup", "19")


def kernel_setting(path: str, text: str) -> None:
    """Write a setting of a process: a file of /proc. Raises OSError."""
    fd = opened_setting(path)
    try:
        os.write(fd, text.encode("ascii"))
    finally:
        os.close(fd)


def opened_setting(path: str) -> int:
    """Open a setting of a process for writing; the caller closes it. Raises OSError."""
    if not path.startswith("/proc/"):
        raise ValueError(f"{path}: not a file of /proc")
    return os.open(path, os.O_WRONLY | _ALWAYS)


def _memory_bytes(field: int) -> int:
    """A field of /proc/self/statm, proc(5); 0: the system does not say."""
    with suppress(OSError, ValueError, IndexError), open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[field]) * os.sysconf("SC_PAGE_SIZE")
    return 0
