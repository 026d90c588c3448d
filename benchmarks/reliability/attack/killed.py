"""kill -9 of text logs and .blf on a busy machine, and disks that become full: what is stated is in the file."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.disks import tmpfs
from benchmarks.reliability.load import load
from benchmarks.reliability.needs import root
from benchmarks.reliability.outcome import Outcome, after_an_end
from benchmarks.reliability.recording import Recording, until
from tests.fixtures.readers import by_canid

PROMISE = "kill -9 costs at most 0.25 s in .asc and .log as in .blf; the count after a full disk is that of the file"
MAX_LOSS_S = 0.25  # s
RATES = (100, 2000, 8000)  # frames/s
MAX_LOAD = 4  # busy processes in addition
FORMATS = (".asc", ".asc", ".log", ".log", ".blf")


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """A kill, and a full disk."""
    yield _kill(folder, rng)
    if not root():
        yield _full(folder, rng)


def _kill(folder: Path, rng: random.Random) -> Outcome:
    suffix, rate, busy = rng.choice(FORMATS), rng.choice(RATES), rng.randrange(MAX_LOAD + 1)
    path = folder / f"x{suffix}"
    sender = Sender(folder, rate)
    with load(busy), Recording(path, talk=folder, bus=sender.words) as recording, sender:
        sender.wait(rng.uniform(0.02, 2.0))
        instant = recording.kill()
        sender.end()
    group = "kill -9 at 100, 2,000, 8,000 frames/s with 0 to 4 busy processes: .asc, .log, .blf"
    outcome = after_an_end(path, sender, instant, group).within(MAX_LOSS_S * judging.busy())  # type: ignore[arg-type]
    about = f" ({suffix}, {rate}/s, load {busy})" if outcome.wrong else ""
    return outcome._replace(wrong=outcome.wrong + about, measure="lost at most")


def _full(folder: Path, rng: random.Random) -> Outcome:
    suffix, size = rng.choice((".blf", ".asc", ".log")), rng.randrange(60, 400)
    wrong = []
    sender = Sender(folder, 8000)
    with (
        tmpfs(folder / "small", f"{size}k") as disk,
        Recording(disk / f"y{suffix}", talk=folder, bus=sender.words) as recording,
        sender,
    ):
        until(lambda: "RECORDING failed" in recording.said or recording.process.poll() is not None)
        sender.wait(rng.uniform(0.0, 0.5), since_now=True)
        code = recording.end() if recording.process.poll() is None else recording.process.returncode
        sender.end()
        reported = recording.reported()
        path = disk / f"y{suffix}"
        kept = len(by_canid(path).frames)
        wrong += judging.missing(judging.read([path]), sender, 0.0, 0.0)
    if code != 5:
        wrong.append(f"exit code {code}")
    if reported["written"] != kept or not kept:
        wrong.append(f"{reported['written']} frames stated, {kept} in the file")
    about = f" ({suffix}, {size} kB)" if wrong else ""
    return Outcome("a small tmpfs becomes full", math.nan, 0, "; ".join(wrong) + about)
