"""kill -9 of text logs and .blf on a busy machine."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.attack import judging
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.load import load
from benchmarks.reliability.outcome import Outcome, after_an_end
from benchmarks.reliability.recording import Recording

PROMISE = "kill -9 costs at most 0.25 s in .asc and .log as in .blf"
MAX_LOSS_S = 0.25  # s
RATES = (100, 2000, 8000)  # frames/s
MAX_LOAD = 4  # busy processes in addition
FORMATS = (".asc", ".asc", ".log", ".log", ".blf")


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """A kill."""
    yield _kill(folder, rng)


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
