"""Memory runs out while canid records: the kernel ends processes of a cgroup until there is enough."""

from __future__ import annotations

import math
import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.outcome import Outcome, after_an_end
from benchmarks.reliability.recording import Recording, until
from tests.fleet.dask_processes import descendants

PROMISE = "where memory runs out every child goes before the recorder, and no frame is lost"
# of the kernel's first version, in which a cgroup may be made anywhere
CGROUPS = Path("/sys/fs/cgroup/memory")
RATES = (500, 2000, 4000)  # frames/s
# verb and words, and how many children it has at least
VERBS = (
    ("live", ("--vehicle", "generic"), 1),
    ("live", ("--vehicle", "generic", "--web", "127.0.0.1:0"), 2),
    ("record", ("--vehicle", "generic", "--trigger", "speed > -1"), 1),
)
# takes memory without an end, a piece at a time: `room` bytes, then more than there are
HOG = "import sys, time\nheld = []\nwhile True:\n    held.append(bytearray(int(sys.argv[1])))\n    time.sleep(0.02)"


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """A recording in a cgroup that another program fills until the kernel has to choose."""
    if not os.access(CGROUPS / "cgroup.procs", os.W_OK):
        yield Outcome(f"not tried: {CGROUPS} is not there, or not this user's", math.nan, 0)
        return
    verb, words, children = rng.choice(VERBS)
    path = folder / "x.blf"
    sender = Sender(folder, rng.choice(RATES))
    with (
        _cgroup(f"canid-{os.getpid()}-{rng.randrange(1 << 30)}") as group,
        Recording(path, *words, verb=verb, talk=folder, bus=sender.words) as recording,
        sender,
    ):
        recorder = recording.process.pid
        until(lambda: len(descendants(recorder)) >= children)
        sender.wait(rng.uniform(0.2, 2.0))
        for pid in (recorder, *descendants(recorder)):
            with suppress(OSError):
                (group / "cgroup.procs").write_text(str(pid))
        before = descendants(recorder)
        used = sum(map(_resident, (recorder, *before)))
        # the other program is smaller than the recorder when its memory ends: the marks of the processes decide
        (group / "memory.limit_in_bytes").write_text(
            str(used + int(_resident(recorder) * rng.uniform(0.2, 0.6)))
        )
        hog = subprocess.Popen([sys.executable, "-I", "-c", HOG, str(rng.randrange(1 << 18, 1 << 22))])
        try:
            (group / "cgroup.procs").write_text(str(hog.pid))
            until(
                lambda: (
                    set(descendants(recorder)) != set(before)
                    or recording.process.poll() is not None
                    or hog.poll() is not None
                )
            )
            spared = not set(before) - set(descendants(recorder))
        finally:
            hog.kill()
            hog.wait()
        time.sleep(rng.uniform(0.0, 1.0))
        gone = recording.process.poll()
        sender.end()
        code = recording.end() if gone is None else gone
        instant = time.time()
    outcome = after_an_end(
        path, sender, instant, "a cgroup that is full: live, live with --web, record --trigger"
    )  # type: ignore[arg-type]
    wrong = [outcome.wrong] if outcome.wrong else []
    wrong += [f"the recorder was ended: {gone}"] if gone is not None else []
    wrong += ["no child was ended first"] if spared else []
    wrong += [f"{outcome.frames} frames lost"] if outcome.frames else []
    wrong += [f"exit code {code}"] if gone is None and code != 143 else []
    about = f" ({verb} {' '.join(words)})" if wrong else ""
    yield outcome._replace(lost=math.nan, wrong="; ".join(wrong) + about)


@contextmanager
def _cgroup(name: str) -> Iterator[Path]:
    group = CGROUPS / name
    group.mkdir()
    try:
        yield group
    finally:
        with suppress(OSError):
            for pid in (group / "cgroup.procs").read_text().split():
                (CGROUPS / "cgroup.procs").write_text(pid)
        with suppress(OSError):
            group.rmdir()


def _resident(pid: int) -> int:
    """Bytes."""
    with suppress(OSError, IndexError, ValueError):
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0
