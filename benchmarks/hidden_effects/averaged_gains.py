"""Which gains may `identify` quote where the driver has a cause that its model has not?

    python -m benchmarks.hidden_effects.averaged_gains [--drives 36] [--first-seed 7000] [--workers 1]

Each seed is a driver behind a lead and one who keeps the lane, and each of them drives twice: with a cause planted, and
clean. Counted are the gains K and sums τ + θ that an estimator may quote, and those of them that hold the driver's: as the
estimators alone leave them, and after `models/diagnosis/causes_not_excluded.py`, which widens intervals and withholds some.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

from benchmarks.hidden_effects.drawn_drives import print_table
from benchmarks.hidden_effects.first_sentence import PLANTED
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.whole_drive import estimates
from canid.mathematics.identification.identifiability import quotable
from canid.models.diagnosis import causes_not_excluded
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.values.types import Array, Channel, Trace
from tests.plants import plant_one, plant_two
from tests.plants.lane_drives import CLEAN, EFFECTS, SIMULATORS, LaneDrive, make
from tests.plants.measurement import trace

BEHIND_LEAD, IN_LANE = "clean, behind a lead", "clean, in the lane"
# parameter -> what of the driver's it is the sum of
PARTS = {
    "K": ("K",),
    "tau": ("tau",),
    "dead_time": ("dead_time",),
    "tau_plus_dead_time": ("tau", "dead_time"),
}
GROUPS = (
    {effect: (effect,) for effect in PLANTED}
    | {"any cause, behind a lead": tuple(PLANTED), BEHIND_LEAD: (BEHIND_LEAD,)}
    | {f"{effect}, in the lane": (f"{effect}, in the lane",) for effect in EFFECTS}
    | {"any cause, in the lane": tuple(f"{effect}, in the lane" for effect in EFFECTS), IN_LANE: (IN_LANE,)}
)


class Quoted(NamedTuple):
    """A number that an estimator alone may quote."""

    kind: str  # what was planted
    estimator: str
    what: str  # "K", "tau_plus_dead_time"
    holds: bool
    left: bool  # quoted still
    holds_then: bool
    wider: float  # factor on the width of its interval


class Driven(NamedTuple):
    """The drives of one seed."""

    quoted: tuple[Quoted, ...]
    cpu: tuple[float, float]  # s behind a lead: the estimators, and the causes


class Planted(NamedTuple):
    """One drive of a seed."""

    kind: str  # what was planted
    trace: Trace
    truth: Mapping[tuple[str, str], float]  # (input, parameter) -> of the driver
    exponent: float = 0.0  # of a gain of range rate that grows with nearness


def behind_lead(seed: int, effect: str, simulator: int) -> Iterator[Planted]:
    """Draw a driver behind a lead and a cause's strength: a drive with it, and a clean one.

    Args:
        seed: of the drives.
        effect: in `PLANTED`.
        simulator: 0 or 1.
    """
    rng = np.random.default_rng(seed)
    name, weakest, strongest = PLANTED[effect]
    strength = float(rng.uniform(weakest, strongest))
    noise = str(rng.choice(("white", "ar1", "mix")))
    cases: dict[str, dict[str, dict[str, float]]] = {effect: {effect: {name: strength}}, BEHIND_LEAD: {}}
    for kind, effects in cases.items():
        made = (plant_one, plant_two)[simulator].plant(
            effects, seed=seed, minutes=10.0, noise=noise, profile="mixed"
        )
        driver = made.truth["driver"]
        truth = {
            (name, what): sum(driver[part + k] for part in parts)
            for k, name in (("1", "headway_error"), ("2", "range_rate"))
            for what, parts in PARTS.items()
        }
        yield Planted(kind, trace(made), truth, effects.get("looming_gain", {}).get("exponent", 0.0))


def planted(seed: int) -> Iterator[Planted]:
    """Draw two drivers, and plant causes: each behind a lead and in the lane, with its cause and clean.

    Args:
        seed: of the drives.
    """
    effect = tuple(PLANTED)[seed % len(PLANTED)]
    yield from behind_lead(seed, effect, seed // len(PLANTED) % 2)
    in_lane = EFFECTS[seed % len(EFFECTS)]
    for kind, hidden in ((f"{in_lane}, in the lane", in_lane), (IN_LANE, CLEAN)):
        drive = make(LaneDrive(SIMULATORS[seed // len(EFFECTS) % 2], hidden, seed))
        yield Planted(kind, drive.trace, {("lateral_offset", "K"): drive.gain})


def run(seed: int) -> Driven:
    """Identify all drives of a seed."""
    quoted, cpu = list[Quoted](), np.zeros(2)
    for drive in planted(seed):
        given = {key: true for key, true in drive.truth.items() if key[1] in ("K", "tau_plus_dead_time")}
        found, took = judged(drive.kind, drive.trace, given)
        quoted += found
        cpu += took if drive.kind in (*PLANTED, BEHIND_LEAD) else 0.0
    print(f"{seed}: {quoted}", file=sys.stderr, flush=True)
    return Driven(tuple(quoted), (float(cpu[0]), float(cpu[1])))


def judged(kind: str, drive: Trace, truth: Mapping[tuple[str, str], float]) -> tuple[list[Quoted], Array]:
    """Identify a drive: the numbers that an estimator alone may quote, and CPU time of estimators and causes, s."""
    begin = time.process_time()
    alone = estimates(fitted_trace(drive), drive, {})
    between = time.process_time()
    left = causes_not_excluded.averaged_over(alone, drive)
    cpu = np.array([between - begin, time.process_time() - between])
    return list(counted(kind, alone, left, truth)), cpu


def counted(
    kind: str,
    alone: Mapping[str, WholeDrive | None],
    left: Mapping[str, WholeDrive | None],
    truth: Mapping[tuple[str, str], float],
) -> Iterator[Quoted]:
    """The numbers of one drive that an estimator alone may quote."""
    for name, result in alone.items():
        after = left[name]
        for (key, what), true in truth.items() if result is not None and after is not None else ():
            before, then = result.channels.get(key, Channel()), after.channels.get(key, Channel())
            if quotable(before, what):
                narrow, wide = getattr(before, what), getattr(then, what)
                holds, holds_then = (iv.low <= true <= iv.high for iv in (narrow, wide))
                wider = (wide.high - wide.low) / (narrow.high - narrow.low)
                yield Quoted(kind, name, what, holds, quotable(then, what), holds_then, wider)


def table(found: Sequence[Driven]) -> list[str]:
    """A row for each planted effect, parameter and estimator."""
    numbers = [number for drive in found for number in drive.quoted]
    lines = [
        "| planted | of | estimator | holds, estimators alone | holds, of what may be quoted | withheld though it holds "
        "| wider, median and 90 % |",
        "|---|---|---|---|---|---|---|",
    ]
    for label, kinds in GROUPS.items():
        for what, estimator in sorted({(number.what, number.estimator) for number in numbers}):
            these = [n for n in numbers if n.kind in kinds and (n.what, n.estimator) == (what, estimator)]
            if not these:
                continue
            left = [number for number in these if number.left]
            lost = sum(number.holds and not number.left for number in these)
            wider = (
                ", ".join(f"{x:.2f}" for x in np.quantile([n.wider for n in left], (0.5, 0.9)))
                if left
                else ""
            )
            lines.append(
                f"| {label.replace('_', ' ')} | {'K' if what == 'K' else 'τ + θ'} | {estimator} "
                f"| {sum(n.holds for n in these)}/{len(these)} | {sum(n.holds_then for n in left)}/{len(left)} | {lost} "
                f"| {wider} |"
            )
    alone, causes = (sum(drive.cpu[k] for drive in found) / max(2 * len(found), 1) for k in (0, 1))
    lines.append("")
    lines.append(
        f"CPU time of 10 min behind a lead: {alone:.2f} s for the estimators, {causes:.2f} s for the causes"
    )
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    return print_table("benchmarks.hidden_effects.averaged_gains", __doc__, 36, 7000, run, table, argv)


if __name__ == "__main__":
    sys.exit(main())
