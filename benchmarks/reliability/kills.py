"""kill -9 at random times: how much is lost, and is the rest whole."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reliability.outcome import Outcome, after_an_end
from benchmarks.reliability.recording import Recording
from tests.fixtures.traffic import Traffic

TRIALS = 200
RATES = (100, 2000, 8000)  # frames/s
# s after the first frame; python-can's own containers take 1.4 s at 2,000 frames/s, 27 s at 100
EARLIEST, LATEST = 0.02, 2.5
MAX_LOSS_S = 0.25  # s


def trial(k: int, seed: int = 0, suffix: str = ".blf", rates: tuple[int, ...] = RATES) -> Iterator[Outcome]:
    """Kill number `k`: the rates in turn, the time at random."""
    rng = random.Random(f"kill {seed} {k}")
    with TemporaryDirectory() as folder:
        yield one(Path(folder), rates[k % len(rates)], rng.uniform(EARLIEST, LATEST), suffix=suffix)


def one(folder: Path, rate: int, after: float, promised: float = MAX_LOSS_S, suffix: str = ".blf") -> Outcome:
    """One kill, `after` s of traffic; wrong where more than `promised` s are lost."""
    path = folder / f"x{suffix}"
    with Recording(path, talk=folder) as recording:
        traffic = Traffic(rate).start()
        traffic.wait(after)
        instant = recording.kill()
        traffic.stop()
    return after_an_end(path, traffic, instant, f"{suffix}, {rate} frames/s").within(promised)
