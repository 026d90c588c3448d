"""Live estimates under noise of the radar and what sensors do: coverage of every quotable number, a window at a time.

    python -m benchmarks live_intervals [--drives 6] [--minutes 8] [--effect WORD] [--whole] [--first-seed 400000]
    python -m benchmarks live_intervals --hidden [--cause NAME] [--drives 36] [--first-seed 400000]

`--hidden`: the drives of `averaged_gains`, 10 min with a cause hidden and clean; `--cause`: behind a lead alone, of one
cause, by its two simulators in turn. A gain that grows with nearness counts
twice: against that at 30 m, as the catalogue defines it, and, as "at its gaps", against that about the gaps of the minute
before, of which a window knows. Else drives of two simulators that are
not canid's (tests/plants/outside_drives.py). The first value of each estimator in every 60 s: FOPDT's windows do not
overlap, ARMAX's memory is longer, so that one drive's noise misses in many rows: the drives with a miss are counted as
well. `--whole`: of the whole drive as well. z is in the interval's own standard deviations, half widths are shares of the
truth: gains of pedals and of accelerations are of different sizes, and a median over both jumps from one to the other.
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.hidden_effects import averaged_gains
from benchmarks.hidden_effects.first_sentence import PLANTED
from canid.analysis.drive import drive_parameters
from canid.mathematics.estimators.agreement import disjoint_parameters
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.identifiability import PARAMETERS
from canid.models.effects.driver.looming_gain import REFERENCE_GAP_M
from canid.values.errors import CanidError
from canid.values.types import QUOTED, Channel, Estimate, Status, Trace
from tests.plants.outside_drives import SIMULATORS, Truth, drawn_drive
from tests.plants.quoted_intervals import Quoted, trace
from tests.plants.sensor_effects import EFFECTS, Drawn, applied

WINDOW_S = 60.0
# factors of the sensors' noise, and effects at the usual noise
NOISES = (0.3, 1.0, 3.0)
STRENGTHS = (
    ("range rate limited", (0.1, 0.25)),
    ("range rate limited on one side", (0.25,)),
    ("gap limited", (0.25,)),
    ("output ends above", (0.25,)),
    ("output ends below", (0.25,)),
    ("output held", (0.2, 0.3)),
    ("radar joined by lines", (0.2,)),
    ("0 without a target", (0.2,)),
)


class Case(NamedTuple):
    """Noise, and an effect or none."""

    noise: float
    effect: Drawn | None = None

    def __str__(self) -> str:
        return f"noise x{self.noise:g}" if self.effect is None else str(self.effect)


class Number(NamedTuple):
    """One quotable number."""

    simulator: str
    seed: int
    case: str
    method: str  # fopdt, armax, headline, or one of a whole drive
    t: float  # s
    quoted: Quoted

    @property
    def z(self) -> float:
        """Error in the half width's own standard deviations, on the side where the truth is."""
        value, low, high = self.quoted.interval
        side = high - value if self.quoted.truth > value else value - low
        return NORMAL_QUANTILE * (value - self.quoted.truth) / max(side, 1e-12)


def cases(word: str = "") -> list[Case]:
    """Noises first."""
    by_name = {effect.name: effect for effect in EFFECTS}
    effects = [Case(1.0, Drawn(by_name[name], x)) for name, strengths in STRENGTHS for x in strengths]
    return [each for each in (*map(Case, NOISES), *effects) if word in str(each)]


def _of(channels: dict[str, Channel], truth: Truth) -> Iterator[Quoted]:
    for name, channel in channels.items():
        for parameter in QUOTED[channel.status]:
            yield Quoted(name, parameter, getattr(channel, parameter), truth.of(name, parameter))


def first_of_minutes(seen: Trace) -> Iterator[Estimate]:
    """The first estimate of each estimator in every `WINDOW_S`, where it has numbers.

    Args:
        seen: a drive.
    """
    minutes = set[tuple[str, float]]()
    for each in drive_parameters.windows(seen):
        # behind a closed gate estimates come at other times than whole minutes
        minute = each.estimator, (each.t + 1e-3) // WINDOW_S
        if each.t < WINDOW_S - 1e-3 or minute in minutes:
            continue
        minutes.add(minute)
        if each.status is Status.OK:
            yield each


def _methods(each: Estimate) -> tuple[str, ...]:
    return (each.estimator, "headline") if each.headline else (each.estimator,)


def hidden(seed: int, cause: str = "") -> list[Number]:
    """Every number that is quotable live of a driver with a cause that no estimator knows, and of the same without it.

    Args:
        seed: of the drives.
        cause: behind a lead; "": that of the seed, and one in the lane.
    """
    out = []
    drives = averaged_gains.behind_lead(seed, cause, seed % 2) if cause else averaged_gains.planted(seed)
    for drive in drives:
        for each in first_of_minutes(drive.trace):
            for key, channel in each.channels.items():
                for what in QUOTED[channel.status]:
                    if (key, what) in drive.truth:
                        one = Quoted(key, what, getattr(channel, what), drive.truth[key, what])
                        put = partial(Number, _task(drive.kind), seed, drive.kind)
                        out += [put(name, each.t, one) for name in _methods(each)]
                        if drive.exponent and (key, what) == ("range_rate", "K"):
                            there = one._replace(truth=_at_gaps(drive, each.t))
                            out += [put(f"{name} at its gaps", each.t, there) for name in _methods(each)]
    return out


def _at_gaps(drive: averaged_gains.Planted, t: float) -> float:
    """K of range rate about the gaps of the minute before t [s], each weighed by its range rate squared."""
    seen = drive.trace
    inside = (seen.t > t - WINDOW_S) & (seen.t <= t) & seen.learn
    weight = seen.inputs[inside, 1] ** 2
    factor = (REFERENCE_GAP_M / seen.signals["gap"][inside]) ** drive.exponent
    return float(drive.truth["range_rate", "K"] * (weight @ factor) / weight.sum())


def _task(kind: str) -> str:
    clean = kind in (averaged_gains.BEHIND_LEAD, averaged_gains.IN_LANE)
    return (
        kind if clean else "any cause, in the lane" if "in the lane" in kind else "any cause, behind a lead"
    )


def numbers(job: tuple[str, int], seconds: float, word: str = "", whole: bool = False) -> list[Number]:
    """Every quotable number of a drive in each case; of whole drives, disjoint pairs are printed."""
    simulator, seed = job
    out = []
    for case in cases(word):
        drive = drawn_drive(simulator, seed, seconds=seconds, noise=case.noise)
        if case.effect is not None:
            drive = applied(drive, (case.effect,), np.random.default_rng([seed, 1]))
        put = partial(Number, simulator, seed, str(case))
        try:
            seen = trace(drive)
        except CanidError:
            continue
        for each in first_of_minutes(seen):
            for one in _of(dict(each.channels), drive.truth):
                out += [put(name, each.t, one) for name in _methods(each)]
        if whole:
            both = {name: r for name, r in drive_parameters.whole_drive(seen).whole.items() if r is not None}
            for name, result in both.items():
                out += [
                    put(f"{name}, whole", seconds, one) for one in _of(dict(result.channels), drive.truth)
                ]
            if len(both) > 1:
                first, second = (result.channels for result in both.values())
                for channel, parameter in disjoint_parameters(first, second, PARAMETERS):
                    print(f"disjoint: {simulator} {seed} {case}: {channel} {parameter}", flush=True)
    return out


def table(every: Iterable[Number], by: str) -> Iterator[str]:
    """A row for each method, channel and parameter, and each `by`."""
    groups: dict[tuple[str, ...], list[Number]] = defaultdict(list)
    for each in every:
        more = (str(getattr(each, by)),) if by else ()
        groups[(each.method, each.quoted.channel, each.quoted.parameter, *more)].append(each)
    names = f"method, parameter{', ' * bool(by)}{by} | quoted | cover | drives | with a miss"
    yield f"| {names} | mean z | sd z | median half width / truth |"
    yield "|---|---|---|---|---|---|---|---|"
    for key, of in sorted(groups.items()):
        z = np.array([each.z for each in of])
        wide = [each.quoted.interval.high - each.quoted.interval.low for each in of]
        half = np.median(0.5 * np.array(wide) / np.abs([each.quoted.truth for each in of]))
        cover = np.mean([each.quoted.covers for each in of])
        drives = {(each.simulator, each.seed) for each in of}
        missed = {(each.simulator, each.seed) for each in of if not each.quoted.covers}
        counts = f"{len(of)} | {cover:.2f} | {len(drives)} | {len(missed)}"
        yield f"| {' '.join(key)} | {counts} | {z.mean():+.2f} | {z.std():.2f} | {half:.3f} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks live_intervals",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=6, help="of each simulator [6]")
    parser.add_argument("--hidden", action="store_true", help="drivers with a hidden cause, drives of 10 min")
    parser.add_argument(
        "--cause", default="", choices=("", *PLANTED), help="that is hidden behind a lead [all]"
    )
    parser.add_argument("--minutes", type=float, default=8.0, help="of each drive [8]")
    parser.add_argument("--effect", default="", help="only cases whose name holds this")
    parser.add_argument("--whole", action="store_true", help="the whole drive as well")
    parser.add_argument("--first-seed", type=int, default=400_000)
    parser.add_argument("--processes", type=int, default=2)
    args = parser.parse_args()
    every: list[Number] = []
    with ProcessPoolExecutor(args.processes) as pool:
        if args.hidden:
            seeds = range(args.first_seed, args.first_seed + args.drives)
            made = zip(seeds, pool.map(partial(hidden, cause=args.cause), seeds), strict=True)
        else:
            jobs = [(name, args.first_seed + k) for k in range(args.drives) for name in SIMULATORS]
            work = partial(numbers, seconds=60.0 * args.minutes, word=args.effect, whole=args.whole)
            made = zip(jobs, pool.map(work, jobs), strict=True)
        for job, found in made:
            every += found
            missed = sum(not each.quoted.covers for each in found)
            print(f"{job}: {missed} of {len(found)} do not cover", flush=True)
    for by in ("", "case", "simulator"):
        print("\n" + "\n".join(table(every, by)))


if __name__ == "__main__":
    main()
