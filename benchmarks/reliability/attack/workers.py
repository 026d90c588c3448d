"""Attacks on the workers of a fleet's run: whoever else is on the computer asks for a socket on which one listens."""

from __future__ import annotations

import math
import random
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.reliability.outcome import Outcome
from tests.fixtures import sockets
from tests.fleet import short_logs
from tests.fleet.dask_processes import descendants

PROMISE = "workers of `canid fleet` listen on no socket: another user of the computer commands nothing"
MOST_WORKERS = 8


def attack(folder: Path, rng: random.Random) -> Iterator[Outcome]:
    """One run, with a drawn number of workers and logs; every socket of its processes is asked for all the time."""
    workers = rng.randint(2, MOST_WORKERS)
    short_logs.write(folder / "logs", workers * rng.randint(1, 2), rng.uniform(2.0, 8.0))
    words = (folder / "logs", "-o", folder / "out", *short_logs.QUICK, "--workers", workers)
    running = subprocess.Popen(
        short_logs.command(*words),
        cwd=short_logs.REPO, env=short_logs.environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    heard: set[sockets.Socket] = set()
    asked, most = 0, 0
    try:
        until = time.monotonic() + short_logs.PATIENCE_S
        while running.poll() is None and time.monotonic() < until:
            below = descendants(running.pid)
            most, asked = max(most, len(below)), asked + 1
            heard |= {*sockets.listening([running.pid, *below])}
            time.sleep(0.02)
    finally:
        running.kill()
        code = running.wait()
    wrong = [f"{each} listens" for each in heard]
    wrong += [f"exit code {code}"] if code else []
    wrong += [f"{most} processes for {workers} workers"] if most < workers else []
    yield Outcome("runs with 2 to 8 workers", math.nan, 0, "; ".join(wrong), tried=asked)
