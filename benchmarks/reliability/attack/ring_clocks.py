"""A ring by age on a computer whose clocks are wrong: then, or now."""

from __future__ import annotations

import math
import random
import subprocess
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.outcome import Outcome
from benchmarks.reliability.recording import Recording

PROMISE = "a ring deletes nothing on the word of a clock that no other clock confirms"
DAY_S = 86_400
FORMATS = (".blf", ".asc", ".log")
_FAKETIME = (
    "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1",
    "/usr/lib/aarch64-linux-gnu/faketime/libfaketime.so.1",
)


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """Two sessions of a ring that keeps a week; between them a clock, or all, go wrong."""
    library = next((path for path in _FAKETIME if Path(path).exists()), "")
    namespaces = not subprocess.run(
        ["unshare", "-T", "--boottime", "5", "true"], capture_output=True, check=False
    ).returncode
    days = rng.randrange(8, 4000)
    cases = []
    if library:
        cases += [
            ("the wall clock is ahead now", 0, days, 0),
            ("the wall clock was behind then", -days, 0, 0),
        ]
    if namespaces:
        cases.append(("the clocks of a time namespace are ahead", 0, 0, days))
    if library and namespaces:
        cases.append(("all clocks say that the days have passed", 0, days, days))
    if cases:
        yield _tried(folder, rng, library, *rng.choice(cases))


def _tried(
    folder: Path, rng: random.Random, library: str, case: str, then: int, now: int, uptime: int
) -> Outcome:
    suffix = rng.choice(FORMATS)
    monotonic = rng.random() < 0.5  # libfaketime sets the monotonic clock as well
    first = _session(folder, suffix, library, then, 0, monotonic=monotonic)
    _session(folder, suffix, library, now, uptime, monotonic=False)
    left = {path.name for path in folder.glob(f"x_*{suffix}")}
    gone = [name for name in first if name not in left]
    wrong = ""
    if uptime and now and len(gone) != len(first):
        wrong = f"{len(first) - len(gone)} of {len(first)} files are kept, although all clocks say that they are old"
    if not (uptime and now) and gone:
        wrong = f"{len(gone)} of {len(first)} files are deleted"
    if not (uptime and now) and not any("ages_not_known" in p.read_text() for p in folder.glob("*.jsonl")):
        wrong += "; nothing in the journal"
    about = f" ({max(abs(then), now, uptime)} days, {suffix}, monotonic {monotonic})" if wrong else ""
    return Outcome(case, math.nan, 0, wrong + about)


def _session(
    folder: Path, suffix: str, library: str, wall: int, uptime: int, *, monotonic: bool
) -> list[str]:
    """Record some files by clocks that are so many days off; their names."""
    environment = {}
    if wall:
        environment = {"LD_PRELOAD": library, "FAKETIME": f"{wall * DAY_S:+d}", "NO_FAKE_STAT": "1"}
        environment["FAKETIME_DONT_FAKE_MONOTONIC"] = "0" if monotonic else "1"
    prefix = []
    if uptime:
        seconds = str(uptime * DAY_S)
        prefix = ["unshare", "-T", "--boottime", seconds, "--monotonic", seconds]
    before = set(folder.glob(f"x_*{suffix}"))
    sender = Sender(folder, 3000)
    words = ("--file-size", 20_000, "--keep-time", "7d")
    with (
        Recording(
            folder / f"x{suffix}",
            *words,
            talk=folder,
            bus=sender.words,
            environment=environment,
            prefix=prefix,
        ) as recording,
        sender,
    ):
        sender.wait(1.5 * min(judging.busy(), 2.0))
        sender.end()
        recording.end()
    return sorted(path.name for path in set(folder.glob(f"x_*{suffix}")) - before)
