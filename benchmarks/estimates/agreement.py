"""How often the estimators contradict each other, for drivers inside and outside the model class.

    python -m benchmarks agreement [--drives 12] [--minutes 6]

First simulated drives through the whole pipeline: two intervals that both hold the truth overlap, so each contradiction
is printed with the estimators that missed the truth. Then drivers whose gain jumps or is not linear, on a closed loop
written for this table alone.
"""

from __future__ import annotations

import argparse
import math
import os
from collections import Counter
from collections.abc import Callable

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import canid
from canid.mathematics.estimators import ESTIMATORS, agreement
from canid.models.pipeline import pipeline
from canid.models.simulation import NOISES, frames, simulate
from canid.signals.vehicle import read_vehicle
from canid.values.types import Array, Estimate, Identifiable, LearnGate, Sample, Status
from tests.pipeline_outputs import outputs

PROFILES = ("mixed", "urban", "motorway")
NAMES = ("headway_error", "range_rate")
JUMP_S = 120.0
GAINS: dict[str, Callable[[float, float], float]] = {
    "linear": lambda t, x: 1.0,
    "x 1.5 at 120 s": lambda t, x: 1.5 if t >= JUMP_S else 1.0,
    "x 2 at 120 s": lambda t, x: 2.0 if t >= JUMP_S else 1.0,
    "x 0.5 at 120 s": lambda t, x: 0.5 if t >= JUMP_S else 1.0,
    "x 0.3 where closing": lambda t, x: 1.0 if x > 0.0 else 0.3,
    "none below 1 m/s": lambda t, x: max(0.0, 1.0 - 1.0 / abs(x)) if x else 0.0,
}


def share(found: list[Estimate]) -> tuple[int, int]:
    """Inconsistent estimates of FOPDT, and all that carry an interval."""
    counted = [
        e.status for e in found if e.estimator == "fopdt" and e.status in (Status.OK, Status.INCONSISTENT)
    ]
    return counted.count(Status.INCONSISTENT), len(counted)


def missed(e: Estimate, truth: dict[str, dict[str, float]]) -> bool:
    """Whether an interval of an estimate misses the truth."""
    for name, ch in e.channels.items():
        of = truth[name]
        pairs = ((ch.K, of["K"]), (ch.tau_plus_dead_time, of["tau"] + of["dead_time"]))
        if ch.status is not Identifiable.NOT and any(iv.low > x or iv.high < x for iv, x in pairs):
            return True
    return False


def simulated(drives: int, minutes: float, first: int) -> None:
    vehicle = read_vehicle("generic")
    kinds = [noise for noise in NOISES if noise != "none"]
    totals = []
    for k in range(drives):
        seed, profile, noise = first + k, PROFILES[k % len(PROFILES)], kinds[k % len(kinds)]
        drive = simulate(minutes=minutes, seed=seed, profile=profile, noise=noise)
        made = outputs(pipeline.build(vehicle), frames(drive, vehicle))
        found = [item for item in made if isinstance(item, Estimate)]
        totals.append(share(found))
        contradicted = [e for e in found if e.status is Status.INCONSISTENT]
        if contradicted:
            by = Counter(e.estimator for e in contradicted if missed(e, drive.truth["channels"]))
            count = f"{totals[-1][0]} of {totals[-1][1]} estimates"
            print(f"  seed {seed} {profile:9} {noise:9} {count}; missed the truth: {dict(by)}")
    some, all_ = (sum(x) for x in zip(*totals, strict=True))
    with_any = sum(x > 0 for x, _ in totals)
    print(
        f"drivers of the model class: inconsistent {100 * some / all_:.1f} % of {all_} estimates, "
        f"in {with_any} of {drives} drives"
    )


def loop(seed: int, gain: Callable[[float, float], float], seconds: float = 260.0, h: float = 0.02) -> Array:
    """(n, 3) pedal, headway error and range rate at 10 Hz; K 4.4 and 5.6 times `gain(t, lagged range rate)`."""
    rng = np.random.default_rng(seed)
    v, gap, x1, x2, noise, goal, lead = 25.0, 45.0, 0.0, 0.0, 0.0, 0.0, 25.0
    errors, rates, rows = [0.0] * 16, [0.0] * 11, []
    for k in range(round(seconds / h)):
        goal += -h / 4.0 * goal + 2.6 * math.sqrt(2 * h / 4.0) * rng.normal()
        lead += h / 2.0 * (25.0 + goal - lead)
        noise += -h * noise + math.sqrt(2 * h) * rng.normal()
        error, rate = gap / v - 1.8, lead - v
        errors, rates = [*errors[1:], error], [*rates[1:], rate]
        x1 += (1 - math.exp(-h / 0.685)) * (errors[0] - x1)
        x2 += (1 - math.exp(-h / 0.4)) * (rates[0] - x2)
        pedal = 25.0 + 4.4 * x1 + 5.6 * gain(k * h, x2) * x2 + noise
        if k % round(pipeline.DT / h) == 0:
            rows.append((pedal, error, rate))
        v += h * (0.8 * (pedal - 25.0) - (v - 25.0)) / 20.0
        gap += h * (lead - v)
    return np.array(rows)


def listen(rows: Array) -> list[Estimate]:
    """Estimates of all estimators, with their agreement tested."""
    running = [estimator.make(NAMES, pipeline.DT) for estimator in ESTIMATORS]
    states, agreed = [estimator.init() for estimator in running], agreement.State()
    out: list[Estimate] = []
    for k, (pedal, *inputs) in enumerate(rows.tolist()):
        sample = Sample(round(k * pipeline.DT, 9), pedal, tuple(inputs), LearnGate.OPEN, True, 0, {})
        spoken = []
        for i, estimator in enumerate(running):
            states[i], estimate = estimator.step(states[i], sample)
            spoken += [estimate] if estimate is not None else []
        agreed, tested = agreement.step(agreed, spoken)
        out += tested
    return out


def others(runs: int, first: int) -> None:
    print(f"{'driver':20} {'runs':>9} {'inconsistent':>14} {'first after':>16} {'armax ok':>9}")
    for name, gain in GAINS.items():
        found = [listen(loop(first + k, gain)) for k in range(runs)]
        late = [[e for e in run if e.t > JUMP_S] for run in found]
        some, all_ = (sum(x) for x in zip(*map(share, late), strict=True))
        onsets = [
            min(e.t for e in run if e.status is Status.INCONSISTENT) - JUMP_S
            for run in late
            if any(e.status is Status.INCONSISTENT for e in run)
        ]
        armax = [
            e.status in (Status.OK, Status.INCONSISTENT)
            for run in late
            for e in run
            if e.estimator == "armax"
        ]
        after = f"{np.median(onsets):.0f} s" if onsets else "–"
        print(
            f"{name:20} {len(onsets):4} of {runs:2} {100 * some / all_:12.1f} % {after:>16} {100 * np.mean(armax):7.0f} %"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks agreement", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--drives", type=int, default=12)
    parser.add_argument("--minutes", type=float, default=6.0)
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--first-seed", type=int, default=1000)
    args = parser.parse_args()
    print(f"canid {canid.__version__}: {args.drives} drives of {args.minutes:g} min; {args.runs} runs a row")
    simulated(args.drives, args.minutes, args.first_seed)
    others(args.runs, args.first_seed)


if __name__ == "__main__":
    main()
