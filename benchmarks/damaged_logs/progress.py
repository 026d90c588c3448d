"""How long a reader goes on without getting on: CPU seconds between two advances, and memory, in a process of its own.

    python -m benchmarks.damaged_logs.progress LOG

What counts as an advance is the position in the file or in what was unpacked of it. A timer that runs with the
process's CPU time samples both, so that waiting for the disk or for other processes costs nothing.
"""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import FrameType
from typing import NamedTuple

# s of CPU between two samples
_EVERY = 0.01


class Measured(NamedTuple):
    """What reading a file frame by column and recovering it took."""

    longest: float  # CPU s between two advances
    cpu: float  # s in all, children included
    memory: float  # MB, the largest of this process or a child
    says: str


def measure(path: Path, limit: float) -> Measured:
    """Read and recover a log in a process of its own, ended after `limit` s."""
    try:
        ran = subprocess.run(
            [sys.executable, "-m", "benchmarks.damaged_logs.progress", str(path)],
            check=True, capture_output=True, text=True, timeout=limit,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Measured(float("inf"), limit, float("nan"), "never ended")
    except subprocess.CalledProcessError as error:
        return Measured(float("nan"), float("nan"), float("nan"), error.stderr.strip().rpartition("\n")[2])
    return Measured(*json.loads(ran.stdout))


def main(path: str) -> None:
    """Measure in this process."""
    import resource

    from canid.io.logs import log, open_log, recovery
    from canid.io.logs.reader_state import ReadState
    from canid.values.errors import CanidError

    states: list[ReadState] = []

    class Watched(ReadState):
        def __init__(self, *args: object, **kwargs: object) -> None:
            super().__init__(*args, **kwargs)  # type: ignore[arg-type]
            states.append(self)

    log.ReadState = Watched  # type: ignore[misc]
    seen: tuple[int, int, int] = (0, 0, 0)
    since, longest = time.process_time(), 0.0

    def sample(_signal: int = 0, _frame: FrameType | None = None) -> None:
        nonlocal seen, since, longest
        now = time.process_time()
        longest = max(longest, now - since)
        at = (len(states), states[-1].done, states[-1].unpacked) if states else (0, 0, 0)
        if at != seen:
            seen, since = at, now

    signal.signal(signal.SIGPROF, sample)
    signal.setitimer(signal.ITIMER_PROF, _EVERY, _EVERY)
    says = ""
    try:
        reading = open_log(path)
        frames = sum(len(chunk.t) for chunk in reading.columns())
        says = reading.damage.says if reading.damage else f"read {frames} frames"
        with tempfile.TemporaryDirectory() as folder:
            recovery.recover(path, Path(folder) / "copy.blf")
    except CanidError as error:
        says = str(error)
    sample()
    signal.setitimer(signal.ITIMER_PROF, 0)
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    # ru_maxrss begins with what the process that started this one had
    status = Path("/proc/self/status").read_text()
    high = int(re.findall(r"VmHWM:\s+(\d+)", status)[0])
    cpu = own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime
    print(json.dumps([longest, cpu, max(high, children.ru_maxrss) / 1024, says]))


if __name__ == "__main__":
    main(sys.argv[1])
