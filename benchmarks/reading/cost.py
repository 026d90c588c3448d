"""CPU seconds of this process, and the largest memory of another one."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

T = TypeVar("T")


class Child(NamedTuple):
    """What a child process needed."""

    cpu: float  # s, user and system, imports included
    peak: float  # MB, the largest resident size (VmHWM)
    out: str


def cpu(work: Callable[[], T], rounds: int) -> tuple[float, T]:
    """Return the fewest CPU seconds of some rounds, and the last result: others on the machine only ever add."""
    best, result = float("inf"), None
    for _ in range(rounds):
        begin = time.process_time()
        result = work()
        best = min(best, time.process_time() - begin)
    assert result is not None
    return best, result


_WATCHED = """
import resource, runpy, sys
sys.argv = sys.argv[1:]
try:
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
except SystemExit as end:
    if end.code not in (None, 0):
        raise
finally:
    high = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
    used = resource.getrusage(resource.RUSAGE_SELF)
    print("needed", used.ru_utime + used.ru_stime, int(high.split()[1]) / 1024, file=sys.stderr)
"""


def child(*words: str | Path) -> Child:
    """Run `python -m WORDS` and return what it needed."""
    command = [sys.executable, "-c", _WATCHED, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    last = done.stderr.strip().rpartition("\n")[2].split()
    if done.returncode or last[:1] != ["needed"]:
        raise SystemExit(f"{' '.join(map(str, words))} failed:\n{done.stderr}")
    return Child(float(last[1]), float(last[2]), done.stdout)
