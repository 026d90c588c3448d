"""Power cuts at random times: what was not synced is thrown away, or came through in part."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.reliability.faulty_disk import FaultyDisk
from benchmarks.reliability.fuse import Mounted
from benchmarks.reliability.outcome import Outcome, after_an_end
from benchmarks.reliability.recording import Recording
from tests.fixtures.readers import by_canid, by_python_can
from tests.fixtures.traffic import Traffic

TRIALS = 50
RATES = (100, 2000, 8000)  # frames/s
EARLIEST, LATEST = 0.02, 2.5  # s
# s per sync: an SSD without a capacitor, an SD card or a disk
SYNCS = (0.005, 0.1)
# for each cut, as many mixtures of sectors that came through
MIXTURES = 10


def trial(k: int, seed: int = 0) -> Iterator[Outcome]:
    """Cut number `k`: the rates in turn and then the disks; nothing later came through, and then a part of it."""
    rng = random.Random(f"cut {seed} {k}")
    rate, sync = RATES[k % len(RATES)], SYNCS[k // len(RATES) % len(SYNCS)]
    with TemporaryDirectory() as folder:
        yield from one(Path(folder), rate, sync, rng.uniform(EARLIEST, LATEST), rng)


def promised(sync: float) -> float:
    """S that a cut costs at most, where a sync takes `sync` s: one may run when a frame comes, and one follows."""
    return 0.25 + 2 * sync


def one(
    folder: Path, rate: int, sync: float, after: float, rng: random.Random, *, busy: float = 1.0
) -> Iterator[Outcome]:
    """One cut, `after` s of traffic; wrong where more than `busy` times the promise is lost."""
    disk = FaultyDisk(stall=sync)
    mount = folder / "disk"
    mount.mkdir()
    with Mounted(disk, mount), Recording(mount / "x.blf", talk=folder) as recording:
        traffic = Traffic(rate).start()
        traffic.wait(after)
        disk.cut()
        instant = recording.kill()
        traffic.stop()
    left = folder / "left"
    left.mkdir()
    disk.leave(left)
    group = f"{rate} frames/s, {sync * 1e3:g} ms per sync"
    yield after_an_end(left / "x.blf", traffic, instant, group).within(busy * promised(sync))
    kept = len(by_canid(left / "x.blf").frames) if (left / "x.blf").exists() else 0
    for k in range(MIXTURES):
        mixed = folder / f"mixed{k}"
        mixed.mkdir()
        disk.leave(mixed, rng)
        yield _mixture(mixed / "x.blf", kept, traffic, instant)


def _mixture(path: Path, kept: int, traffic: Traffic, instant: float) -> Outcome:
    """At least what was synced is there, and nothing false."""
    group = "a part of what was not synced came through"
    if not path.exists():
        return Outcome(
            group, math.nan, 0, f"{kept} frames had been synced, and the file is gone" if kept else ""
        )
    outcome = after_an_end(path, traffic, instant, group, whole=False)
    n = len(by_canid(path).frames)
    wrong = outcome.wrong or ("synced frames are missing" if n < kept else "")
    # a torn end: another reader may complain there, what is before it must be the same
    other = len(by_python_can(path).frames)
    return outcome._replace(lost=math.nan, wrong=wrong or ("python-can reads fewer" if other < kept else ""))
