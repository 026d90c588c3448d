"""Which gains may `identify` quote where the driver has a cause that its model has not?

    python -m benchmarks.hidden_effects.averaged_gains [--drives 36] [--first-seed 7000] [--workers 1]

Each seed is a driver behind a lead and one who keeps the lane, and each of them drives twice: with a cause planted, and
clean. Counted are the gains K that an estimator may quote, and those of them that hold the driver's: as the estimators
alone leave them, and after `models/diagnosis/averaged_gain.py`.
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
from canid.models.diagnosis import averaged_gain
from canid.signals.signal_checks.drive_time import fitted_trace
from canid.values.types import Array, Trace
from tests.plants import plant_one, plant_two
from tests.plants.lane_drives import CLEAN, EFFECTS, SIMULATORS, LaneDrive, make
from tests.plants.measurement import trace

BEHIND_LEAD, IN_LANE = "clean, behind a lead", "clean, in the lane"
GROUPS = (
    {effect: (effect,) for effect in PLANTED}
    | {"any cause, behind a lead": tuple(PLANTED), BEHIND_LEAD: (BEHIND_LEAD,)}
    | {f"{effect}, in the lane": (f"{effect}, in the lane",) for effect in EFFECTS}
    | {"any cause, in the lane": tuple(f"{effect}, in the lane" for effect in EFFECTS), IN_LANE: (IN_LANE,)}
)


class Gain(NamedTuple):
    """A gain that an estimator alone may quote."""

    kind: str  # what was planted
    estimator: str
    holds: bool
    left: bool  # quoted still


class Driven(NamedTuple):
    """The drives of one seed."""

    gains: tuple[Gain, ...]
    cpu: tuple[float, float]  # s behind a lead: the estimators, and the causes


def run(seed: int) -> Driven:
    """Draw two drivers, plant causes, and identify all drives."""
    rng = np.random.default_rng(seed)
    effect = tuple(PLANTED)[seed % len(PLANTED)]
    name, weakest, strongest = PLANTED[effect]
    planted = float(rng.uniform(weakest, strongest))
    plant = (plant_one, plant_two)[seed // len(PLANTED) % 2]
    noise = str(rng.choice(("white", "ar1", "mix")))
    gains, cpu = list[Gain](), np.zeros(2)
    cases: dict[str, dict[str, dict[str, float]]] = {effect: {effect: {name: planted}}, BEHIND_LEAD: {}}
    for kind, effects in cases.items():
        made = plant.plant(effects, seed=seed, minutes=10.0, noise=noise, profile="mixed")
        driver = made.truth["driver"]
        found, took = judged(kind, trace(made), {"headway_error": driver["K1"], "range_rate": driver["K2"]})
        gains, cpu = gains + found, cpu + took
    in_lane = EFFECTS[seed % len(EFFECTS)]
    for kind, hidden in ((f"{in_lane}, in the lane", in_lane), (IN_LANE, CLEAN)):
        drive = make(LaneDrive(SIMULATORS[seed // len(EFFECTS) % 2], hidden, seed))
        gains += judged(kind, drive.trace, {"lateral_offset": drive.gain})[0]
    print(f"{seed} {effect} {planted:.3g}, {in_lane}: {gains}", file=sys.stderr, flush=True)
    return Driven(tuple(gains), (float(cpu[0]), float(cpu[1])))


def judged(kind: str, drive: Trace, truth: Mapping[str, float]) -> tuple[list[Gain], Array]:
    """Identify a drive: the gains that an estimator alone may quote, and CPU time of estimators and causes, s."""
    begin = time.process_time()
    alone = estimates(fitted_trace(drive), drive, {})
    between = time.process_time()
    left = averaged_gain.without_averages(alone, drive)
    cpu = np.array([between - begin, time.process_time() - between])
    return list(counted(kind, alone, left, truth)), cpu


def counted(
    kind: str,
    alone: Mapping[str, WholeDrive | None],
    left: Mapping[str, WholeDrive | None],
    truth: Mapping[str, float],
) -> Iterator[Gain]:
    """The gains of one drive that an estimator alone may quote."""
    for name, result in alone.items():
        after = left[name]
        for key, channel in result.channels.items() if result is not None and after is not None else ():
            if quotable(channel, "K"):
                holds = channel.K.low <= truth[key] <= channel.K.high
                yield Gain(kind, name, holds, quotable(after.channels[key], "K"))


def table(found: Sequence[Driven]) -> list[str]:
    """A row for each planted effect and estimator."""
    gains = [gain for drive in found for gain in drive.gains]
    lines = [
        "| planted | estimator | K holds, estimators alone | K holds, of what may be quoted | withheld though it holds |",
        "|---|---|---|---|---|",
    ]
    for label, kinds in GROUPS.items():
        for estimator in sorted({gain.estimator for gain in gains}):
            these = [gain for gain in gains if gain.kind in kinds and gain.estimator == estimator]
            if not these:
                continue
            quoted = [gain for gain in these if gain.left]
            lost = sum(gain.holds and not gain.left for gain in these)
            shares = " | ".join(f"{sum(gain.holds for gain in some)}/{len(some)}" for some in (these, quoted))
            lines.append(f"| {label.replace('_', ' ')} | {estimator} | {shares} | {lost} |")
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
