"""A wheel at its lock: is the lock found, does a gain that is quoted hold the truth, which causes are named.

    python -m benchmarks lane_ends [--drives 6] [--minutes 10] [--first-seed 41]

Drives of the lane keeper that is not canid's (tests/plants/lane_two.py), whose wheel has a lock on either side, sampled at
10, 20 and 50 Hz in steps of 0.1° and given to canid as arrays.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from canid.signals.samples.learning_gate import with_limits
from canid.values.types import QUOTED, Channel, LearnGate, Trace
from tests.plants import lane_two
from tests.plants.lane_measurement import ANGLE_STEP, OFFSET_STEP_M, rounded

SHARES = (0.0, 0.05, 0.1, 0.25)
RATES_HZ = (10, 20, 50)
# 1/m, standard deviation of the road's curvature on every other drive
CURVES = 3e-4
# rounds in which the locks are moved to where they are met for the share of the time: they change what the loop asks for
ROUNDS = 3


class Outcome(NamedTuple):
    """One drive at one rate."""

    seed: int
    share: float  # asked for
    rate: int  # Hz
    at_lock: float  # share of the time, as simulated
    found: float  # the same as canid has it
    covers: dict[str, bool]  # "identify", "diagnose" -> does K, where it is quoted, hold the truth
    causes: tuple[str, ...]


def locked_drive(seed: int, share: float, minutes: float) -> tuple[lane_two.Lane, float]:
    """A drive whose wheel is at one of its locks for about a share of the time, and for which share it is."""
    how = {
        "seed": seed, "minutes": minutes, "noise": lane_two.NOISES[seed % len(lane_two.NOISES)],
        "curves": CURVES * (seed % 2),
    }  # fmt: skip
    drive, now = lane_two.plant({}, **how), 0.0  # type: ignore[arg-type]
    if not share:
        return drive, now
    low, high = np.quantile(drive.columns["steering_angle"], [0.5 * share, 1.0 - 0.5 * share]).tolist()
    for _ in range(ROUNDS):
        drive = lane_two.plant({}, **how, lock=(low, high))  # type: ignore[arg-type]
        angle = drive.columns["steering_angle"]
        now = float(np.mean((angle <= low) | (angle >= high)))
        if abs(now - share) < 0.2 * share:
            break
        wider = 0.25 * (high - low) * (now - share) / max(share, 0.1)
        low, high = low - wider, high + wider
    return drive, now


def sampled(drive: lane_two.Lane, rate: int) -> Trace:
    """The drive as a table of this rate."""
    every = round(1.0 / (rate * drive.dt))
    columns = {name: x[::every] for name, x in drive.columns.items()}
    columns["steering_angle"] = rounded(columns["steering_angle"], ANGLE_STEP)
    columns["lateral_offset"] = rounded(columns["lateral_offset"], OFFSET_STEP_M)
    return canid.from_arrays(time=columns.pop("t"), task="lane_keeping", **columns)


def outcomes(job: tuple[int, float, float]) -> list[Outcome]:
    """One drive at every rate."""
    drive, at_lock = locked_drive(*job)
    truth, out = -drive.truth["driver"]["K"], []
    for rate in RATES_HZ:
        trace = sampled(drive, rate)
        found = [gate is LearnGate.OUTPUT_LIMIT for gate in with_limits(trace).gate]
        report = canid.diagnose(trace)
        said: dict[str, Channel] = {
            "identify": canid.identify(trace, select_orders=False, sliding=False).channels["lateral_offset"],
            "diagnose": report.extended.channels["lateral_offset"],
        }
        covers = {
            name: channel.K.low <= truth <= channel.K.high
            for name, channel in said.items()
            if "K" in QUOTED[channel.status]
        }
        causes = tuple(each.effect for each in report.findings)
        out.append(Outcome(job[0], job[1], rate, at_lock, float(np.mean(found)), covers, causes))
    return out


def rows(found: Sequence[Outcome]) -> Iterator[str]:
    """The table, one row for each share and rate."""
    yield "| at a lock | rate | lock found | K holds / quoted: identify | diagnose | causes |"
    yield "|---|---|---|---|---|---|"
    for share in SHARES:
        for rate in RATES_HZ:
            some = [one for one in found if (one.share, one.rate) == (share, rate)]
            cells = [f"{np.mean([one.at_lock for one in some]):.2f}", f"{rate} Hz"]
            cells.append(f"{sum(one.found > 0.8 * one.at_lock > 0.0 for one in some)}/{len(some)}")
            for name in ("identify", "diagnose"):
                covers = [one.covers[name] for one in some if name in one.covers]
                cells.append(f"{sum(covers)}/{len(covers)}")
            causes = Counter(name for one in some for name in one.causes)
            cells.append(", ".join(f"`{name}` {number}" for name, number in causes.items()) or "none")
            yield f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks lane_ends",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=6, help="of each share; default: 6")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--first-seed", type=int, default=41)
    parser.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    seeds = range(args.first_seed, args.first_seed + args.drives)
    jobs = [(seed, share, args.minutes) for seed in seeds for share in SHARES]
    with ProcessPoolExecutor(args.processes) as pool:
        for line in rows([one for each in pool.map(outcomes, jobs) for one in each]):
            print(line)


if __name__ == "__main__":
    main()
