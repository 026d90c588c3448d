"""The population's prior for a new driver's first minute, `python -m benchmarks population_prior [--fleets N] [--data DIR]`.

Simulated: fleets of 30 drivers with a drive of 4 min each; five folds, each of which makes a prior of 24 drivers (pooled as
`canid fleet` does) for the 6 others. Intervals after 60 s with that prior and without: width, and whether they hold the
truth; then drivers whose gains are 4 standard deviations off, after 60 s and after the whole drive. Measured: each driver of
asta and openacc is left out in turn, and each minute of the drive is a first minute; the truth is the whole drive's
estimate with its own interval.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from benchmarks.fleet.prior_drives import (
    FIRST_S,
    NAMES,
    Drive,
    channels,
    drive,
    driver,
    fleet_estimate,
    people,
    table,
)
from canid.mathematics.identification.fopdt.prior import Prior
from canid.mathematics.population.drive_table import drive_table
from canid.mathematics.population.hierarchical import MIN_DRIVERS, Population, pool
from canid.mathematics.population.population_prior import prior_of
from canid.signals.samples.trace_assembly import part
from canid.values.types import Channel, Identifiable, Interval, Trace

DRIVERS = 30
FOLDS = 5
# standard deviations, of the gains of headway error and of range rate
ATYPICAL = ((4.0, 0.0), (0.0, 4.0), (0.0, -3.0))
PARAMETERS = (
    ("headway_error", "K", "K1"),
    ("range_rate", "K", "K2"),
    ("headway_error", "tau_plus_dead_time", "τ1+θ1"),
    ("range_rate", "tau_plus_dead_time", "τ2+θ2"),
)


# the parameters that a minute shows at all
MAIN = ("K1", "K2", "τ2+θ2")


class Pair(NamedTuple):
    """One parameter of one window, without and with the prior."""

    driver: str
    name: str
    without: Interval
    known: Interval
    truth: Interval  # with its own interval; of a simulated drive a point
    quotable: tuple[bool, bool]
    share: float  # of the prior


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=4, help="simulated fleets of 30 drivers")
    parser.add_argument("--first-seed", type=int, default=77_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="folder with asta and openacc"
    )
    args = parser.parse_args()
    began = time.perf_counter()
    seeds = [args.first_seed + 1000 * k for k in range(args.fleets)]
    with ProcessPoolExecutor(args.workers) as processes:
        done = list(processes.map(fleet, seeds))
    typical = [pair for pairs, _, _ in done for pair in pairs]
    if typical:
        print(f"**{args.fleets} simulated fleets of {DRIVERS} drivers, after 60 s**\n")
        print("\n".join(lines(typical)))
        print("\n**Drivers whose gains are 3 or 4 sd off: the parameter that is off, after 60 s**\n")
        print("\n".join(lines([pair for _, pairs, _ in done for pair in pairs])))
        print("\n**The same drivers, after the whole drive of 4 min**\n")
        print("\n".join(lines([pair for _, _, pairs in done for pair in pairs])))
    logs = sorted([*args.data.glob("asta/*.blf"), *args.data.glob("openacc/human*.blf")])
    if logs:
        print(f"\n**{len(logs)} measured drives, each minute as the first one**\n")
        with ProcessPoolExecutor(args.workers) as processes:
            found = measured(logs, processes)
        print("\n".join(lines(found)))
        print("\n**By driver: windows; K1, K2 hold the whole drive's without and with the prior**\n")
        for log in logs:
            own = [
                [p for p in found if (p.driver, p.name) == (log.stem, name) and has_fit(p)]
                for name in ("K1", "K2")
            ]
            held = [
                np.mean([holds(getattr(p, of), p.truth) for p in k])
                for k in own
                for of in ("without", "known")
            ]
            print(f"{log.stem}: {len(own[0])}; " + ", ".join(f"{share:.2f}" for share in held))
    print(f"\nseeds {seeds}, {time.perf_counter() - began:.0f} s")


def prior(found: Population) -> Prior | None:
    """The prior of what at least `MIN_DRIVERS` drivers are known by, as `canid fleet prior`."""
    value = np.where(found.counts[:, 1] >= MIN_DRIVERS, found.new_driver.value, np.nan)
    return prior_of(found.names, value, found.new_driver.covariance)


def fleet(seed: int) -> tuple[list[Pair], list[Pair], list[Pair]]:
    """Typical drivers after 60 s, atypical ones after 60 s, and after the whole drive."""
    rng = np.random.default_rng([seed, 77])
    of = people(rng)
    drives = [drive(k + seed // 1000, driver(of, rng), seed + k) for k in range(DRIVERS)]
    typical: list[Pair] = []
    for fold in range(FOLDS):
        known = prior(pool(table([one for k, one in enumerate(drives) if k % FOLDS != fold])))
        for one in drives[fold::FOLDS]:
            typical += pairs(one.first, known, _truth(one))
    early: list[Pair] = []
    late: list[Pair] = []
    known = prior(pool(table(drives)))
    for k in range(12):
        off = ATYPICAL[k % len(ATYPICAL)]
        one = drive(k + seed // 1000, driver(of, rng, off), seed + 500 + k)
        which = {"K1"} if off[0] else {"K2"}
        for span, out in ((one.first, early), (one.whole, late)):
            out += [pair for pair in pairs(span, known, _truth(one)) if pair.name in which]
    return typical, early, late


def _truth(one: Drive) -> dict[str, Interval]:
    of = one.truth
    values = {"K1": of["K1"], "K2": of["K2"]}
    values |= {f"τ{k}+θ{k}": of[f"tau{k}"] + of[f"dead_time{k}"] for k in (1, 2)}
    return {name: Interval(x, x, x) for name, x in values.items()}


def pairs(of: Trace, known: Prior | None, truth: dict[str, Interval], driver: str = "") -> list[Pair]:
    """Each parameter of a window, without and with the prior."""
    without, with_prior = channels(of, None), channels(of, known)
    return [
        Pair(
            driver,
            name,
            getattr(without[channel], parameter),
            getattr(with_prior[channel], parameter),
            truth[name],
            (_quotable(without[channel], parameter), _quotable(with_prior[channel], parameter)),
            with_prior[channel].prior_weights.get(parameter, 0.0),
        )
        for channel, parameter, name in PARAMETERS
    ]


def _quotable(channel: Channel, parameter: str) -> bool:
    if parameter == "K":
        return channel.status is not Identifiable.NOT
    return channel.status in (Identifiable.OK, Identifiable.SUM_ONLY)


def holds(found: Interval, truth: Interval) -> bool:
    """Whether an interval holds a truth that has an interval itself: both half-widths add as independent errors."""
    above = truth.value > found.value
    own = found.high - found.value if above else found.value - found.low
    of_truth = truth.value - truth.low if above else truth.high - truth.value
    return abs(truth.value - found.value) <= math.hypot(own, of_truth)


def measured(logs: Sequence[Path], processes: ProcessPoolExecutor) -> list[Pair]:
    """Each minute of each drive, with the prior of the other drivers."""
    read = list(processes.map(_read, logs))
    out: list[Pair] = []
    jobs = []
    for k, (drives, truth, _) in enumerate(read):
        others = [estimate for j, (_, _, estimate) in enumerate(read) if j != k]
        estimate, covariance = (np.array(x) for x in zip(*others, strict=True))
        names = tuple(path.stem for j, path in enumerate(logs) if j != k)
        known = prior(pool(drive_table(NAMES, estimate, covariance, names)))
        rows = round(FIRST_S / drives.dt)
        starts = range(0, len(drives.t) - rows, rows)
        jobs += [
            (part(drives, slice(start, start + rows + 1)), known, truth, logs[k].stem) for start in starts
        ]
    for found in processes.map(pairs, *zip(*jobs, strict=True)):
        out += found
    return out


def _read(path: Path) -> tuple[Trace, dict[str, Interval], tuple[np.ndarray, np.ndarray]]:
    drives = canid.read_trace(path, "openacc_asta" if path.parent.name == "asta" else "openacc")
    whole = channels(drives, None)
    truth = {name: getattr(whole[channel], parameter) for channel, parameter, name in PARAMETERS}
    return drives, truth, fleet_estimate(drives)


def has_fit(pair: Pair) -> bool:
    """Whether the window has enough data for a fit at all."""
    return math.isfinite(pair.without.high - pair.without.low)


def lines(every: Iterable[Pair]) -> list[str]:
    """The table: medians and distribution of the ratio of widths, coverage, how often a parameter may be quoted."""
    every = [pair for pair in every if has_fit(pair)]
    out = [
        "|  | n | width | with prior | ratio (10 to 90 %) | holds truth | with prior | quotable | with prior | of prior |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    there = {pair.name for pair in every}
    groups = {name: {name} for *_, name in PARAMETERS if name in there}
    if len(groups) > len(MAIN):
        groups[", ".join(MAIN)] = set(MAIN)
    for name, names in groups.items():
        own = [pair for pair in every if pair.name in names]
        before = np.array([pair.without.high - pair.without.low for pair in own])
        after = np.array([pair.known.high - pair.known.low for pair in own])
        low, middle, high = np.quantile(after / before, (0.1, 0.5, 0.9))
        shares = [
            np.mean([holds(pair.without, pair.truth) for pair in own]),
            np.mean([holds(pair.known, pair.truth) for pair in own]),
            np.mean([pair.quotable[0] for pair in own]),
            np.mean([pair.quotable[1] for pair in own]),
            np.median([pair.share for pair in own]),
        ]
        numbers = " | ".join(f"{x:.3f}" for x in shares)
        out.append(
            f"| {name} | {len(own)} | {np.median(before):.2f} | {np.median(after):.2f} | "
            f"{middle:.2f} ({low:.2f} to {high:.2f}) | {numbers} |"
        )
    return out


if __name__ == "__main__":
    main()
