"""An output at its limit: coverage, efficiency and false causes, by share of the time at the limit.

    python -m benchmarks measurement_ends [--drives 6] [--minutes 10] [--diagnosed 0] [--first-seed 41000]

Drives of two simulators that are not canid's (limited_drives.py). Each is compared with the same driver, lead and noise
without the limit: half widths are ratios of medians. No number of a drive without a limit depends on the limits.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from benchmarks.measurement_effects.drives import trace
from benchmarks.measurement_effects.limited_drives import Side, at_limit, limited_drive
from canid.analysis.drive.drive_parameters import Identified
from canid.values.types import QUOTED, Channel

SIDES: tuple[Side, ...] = ("upper", "lower")
SHARES = (0.1, 0.25, 0.5)
SIMULATORS = ("Helly", "acceleration")
# parameters of the range rate, the channel that every one of these drives knows; the simulated answer of the acceleration to
# the headway saturates, and behind a limit the headway goes there
JUDGED = (("range_rate", "K"), ("range_rate", "tau"), ("range_rate", "dead_time"))


class Job(NamedTuple):
    """One drive."""

    simulator: str
    seed: int
    share: float
    side: Side
    minutes: float
    diagnosed: bool


class Number(NamedTuple):
    """A parameter as one estimator quotes it."""

    estimator: str
    channel: str
    parameter: str
    covers: bool
    half: float  # of its interval


class Outcome(NamedTuple):
    """What canid says of a drive."""

    job: Job
    share: float  # at the limit, as simulated
    numbers: tuple[Number, ...]
    causes: tuple[str, ...]  # named


def numbers(result: Identified, truth: dict[tuple[str, str], float]) -> list[Number]:
    """What may be quoted of each estimator over the whole drive."""
    out = []
    for name, whole in result.whole.items():
        if whole is None:
            continue
        for channel, parameter in JUDGED:
            said: Channel = whole.channels[channel]
            if parameter in QUOTED[said.status]:
                value = getattr(said, parameter)
                covers = value.low <= truth[channel, parameter] <= value.high
                out.append(Number(name, channel, parameter, covers, 0.5 * (value.high - value.low)))
    return out


def outcome(job: Job) -> Outcome:
    drive = limited_drive(job.simulator, job.seed, job.share, job.side, seconds=60.0 * job.minutes)
    given = trace(drive)
    result = canid.identify(given, select_orders=False, sliding=False)
    truth = {(channel, parameter): drive.truth.of(channel, parameter) for channel, parameter in JUDGED}
    causes: tuple[str, ...] = ()
    if job.diagnosed:
        causes = tuple(each.effect for each in canid.diagnose(given).findings)
    return Outcome(job, at_limit(drive, job.side), tuple(numbers(result, truth)), causes)


def rows(found: list[Outcome]) -> list[str]:
    """The table, one row for each simulator, side and share."""
    out = [
        "| output, limit | share | drives | covering / quoted: FOPDT | ARMAX | half widths: FOPDT | ARMAX | causes |"
    ]
    out.append("|---|---|---|---|---|---|---|---|")
    for simulator in SIMULATORS:
        free = [one for one in found if one.job.simulator == simulator and not one.job.share]
        for side, share in [("none", 0.0), *((side, share) for side in SIDES for share in SHARES)]:
            some = [
                one
                for one in found
                if (one.job.simulator, one.job.share) == (simulator, share)
                and (not share or one.job.side == side)
            ]
            if not some:
                continue
            cells = [f"{simulator}, {side}", f"{np.mean([one.share for one in some]):.2f}", str(len(some))]
            for name in ("fopdt", "armax"):
                said = [number.covers for one in some for number in one.numbers if number.estimator == name]
                cells.append(f"{sum(said)} / {len(said)} of {len(JUDGED) * len(some)}")
            cells += [_efficiency(some, free, name) for name in ("fopdt", "armax")]
            diagnosed = [one for one in some if one.job.diagnosed]
            named = [cause for one in diagnosed for cause in one.causes]
            cells.append(f"{', '.join(named) or 'none'} of {len(diagnosed)}")
            out.append(f"| {' | '.join(cells)} |")
    return out


def _efficiency(some: list[Outcome], free: list[Outcome], estimator: str) -> str:
    """Half width of K of the range rate, over that of the same drives without a limit."""

    def half(of: list[Outcome]) -> float:
        key = (estimator, *JUDGED[0])
        halves = [n.half for one in of for n in one.numbers if (n.estimator, n.channel, n.parameter) == key]
        return float(np.median(halves)) if halves else np.nan

    return f"×{half(some) / half(free):.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks measurement_ends",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=6, help="of each kind; default: 6")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--diagnosed", type=int, default=0, help="of them, diagnosed as well; default: 0")
    parser.add_argument("--first-seed", type=int, default=41_000)
    parser.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    kinds: list[tuple[float, Side]] = [(0.0, "upper"), *((share, side) for side in SIDES for share in SHARES)]
    jobs = [
        Job(simulator, args.first_seed + k, share, side, args.minutes, k < args.diagnosed)
        for k in range(args.drives)
        for simulator in SIMULATORS
        for share, side in kinds
    ]
    with ProcessPoolExecutor(args.processes) as pool:
        found = []
        for one in pool.map(outcome, jobs):
            found.append(one)
            missed = [n for n in one.numbers if not n.covers]
            if missed or one.causes:
                says = ", ".join(f"{n.estimator} {n.channel} {n.parameter}" for n in missed)
                print(
                    f"{one.job.seed} {one.job.simulator} {one.job.side} {one.share:.2f}: {says}; {one.causes}",
                    flush=True,
                )
    for line in rows(found):
        print(line)


if __name__ == "__main__":
    main()
