"""Memory runs out while canid records: the kernel ends processes of a cgroup until there is enough."""

from __future__ import annotations

import math
import os
import random
import socket
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
    ("live", ("--vehicle", "generic", "--web"), 2),
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
    if "--web" in words:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            words = (*words, f"127.0.0.1:{free.getsockname()[1]}")
    path = folder / "x.blf"
    sender = Sender(folder, rng.choice(RATES))
    with (
        _cgroup(f"canid-{os.getpid()}-{rng.randrange(1 << 30)}") as group,
        Recording(path, *words, verb=verb, talk=folder, bus=sender.words, prefix=_inside(group)) as recording,
        sender,
    ):
        yield _filled(path, group, recording, sender, children, rng)


def _filled(
    path: Path, group: Path, recording: Recording, sender: Sender, least: int, rng: random.Random
) -> Outcome:
    """The other program begins once all children are there, and ends once the kernel has ended something."""
    recorder = recording.process.pid
    before = _settled(recorder, least)
    sender.wait(rng.uniform(0.2, 2.0))
    # room for less than the recorder holds, so that it is not the size that decides
    room = int(_resident(recorder) * rng.uniform(0.2, 0.6))
    (group / "memory.limit_in_bytes").write_text(str(_held(group) + room))
    words = [sys.executable, "-I", "-c", HOG, str(rng.randrange(1 << 18, 1 << 22))]
    hog = subprocess.Popen([*_inside(group), *words])
    try:
        until(
            lambda: (
                bool(before - _children(recorder))
                or recording.process.poll() is not None
                or hog.poll() is not None
            )
        )
        spared = before <= _children(recorder)
    finally:
        hog.kill()
        hog.wait()
    time.sleep(rng.uniform(0.0, 1.0))
    gone = recording.process.poll()
    sender.end()
    code = recording.end() if gone is None else gone
    outcome = after_an_end(
        path, sender, time.time(), "a cgroup that is full: live, live with --web, record --trigger"
    )  # type: ignore[arg-type]
    wrong = [outcome.wrong] if outcome.wrong else []
    wrong += [f"the recorder was ended: {gone}"] if gone is not None else []
    wrong += ["no child was ended first"] if spared else []
    wrong += [f"{outcome.frames} frames lost"] if outcome.frames else []
    wrong += [f"exit code {code}"] if gone is None and code != 143 else []
    about = f" ({recording.said[-200:]})" if wrong else ""
    return outcome._replace(lost=math.nan, wrong="; ".join(wrong) + about)


def _inside(group: Path) -> tuple[str, ...]:
    """What starts a program in a cgroup, so that what it holds is counted from its beginning."""
    return ("sh", "-c", 'echo $$ >"$0" && exec "$@"', str(group / "cgroup.procs"))


def _settled(pid: int, least: int) -> set[int]:
    """Its children, once there are enough and the same for 2 s."""
    before, since = _children(pid), time.monotonic()

    def settled() -> bool:
        nonlocal before, since
        now = _children(pid)
        if now != before or len(now) < least:
            before, since = now, time.monotonic()
        return time.monotonic() - since > 2.0

    until(settled)
    return before


def _held(group: Path) -> int:
    """Bytes that its processes hold, without copies of files."""
    stat = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
    return int(stat["total_rss"])


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


def _children(pid: int) -> set[int]:
    """Those that run; one that was ended is listed until its parent has asked for it."""
    found = set()
    for child in descendants(pid):
        with suppress(OSError):
            if Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX":
                found.add(child)
    return found


def _resident(pid: int) -> int:
    """Bytes."""
    with suppress(OSError, IndexError, ValueError):
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0
