"""Which gains may `identify` quote where the driver has a cause that its model has not?

    python -m benchmarks.hidden_effects.averaged_gains [--drives 36] [--first-seed 7000] [--workers 1]

Each drive is driven twice, of 10 min, by the same driver: with a cause planted, as in `first_sentence`, and clean. Counted
are the gains K that an estimator may quote, and those of them that hold the driver's: as the estimators alone leave them,
and after `models/diagnosis/averaged_gain.py`.
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
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

TRUE_GAIN = {"headway_error": "K1", "range_rate": "K2"}


class Gain(NamedTuple):
    """A gain that an estimator alone may quote."""

    effect: str  # planted; "clean": none
    estimator: str
    holds: bool
    left: bool  # quoted still


class Driven(NamedTuple):
    """Both drives of one seed."""

    gains: tuple[Gain, ...]
    cpu: tuple[float, float]  # s: the estimators, and the causes


def run(seed: int) -> Driven:
    """Draw a driver, plant a cause, and identify both drives."""
    rng = np.random.default_rng(seed)
    effect = tuple(PLANTED)[seed % len(PLANTED)]
    name, weakest, strongest = PLANTED[effect]
    planted = float(rng.uniform(weakest, strongest))
    plant = (plant_one, plant_two)[seed // len(PLANTED) % 2]
    noise = str(rng.choice(("white", "ar1", "mix")))
    gains, cpu = list[Gain](), np.zeros(2)
    cases: dict[str, dict[str, dict[str, float]]] = {effect: {effect: {name: planted}}, "clean": {}}
    for kind, effects in cases.items():
        made = plant.plant(effects, seed=seed, minutes=10.0, noise=noise, profile="mixed")
        drive = trace(made)
        begin = time.process_time()
        alone = estimates(fitted_trace(drive), drive, {})
        between = time.process_time()
        left = averaged_gain.without_averages(alone, drive)
        cpu += (between - begin, time.process_time() - between)
        gains += counted(kind, alone, left, made.truth["driver"])
    print(f"{seed} {effect} {planted:.3g}: {gains}", file=sys.stderr, flush=True)
    return Driven(tuple(gains), (float(cpu[0]), float(cpu[1])))


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
                holds = channel.K.low <= truth[TRUE_GAIN[key]] <= channel.K.high
                yield Gain(kind, name, holds, quotable(after.channels[key], "K"))


def table(found: Sequence[Driven]) -> list[str]:
    """A row for each planted effect and estimator."""
    gains = [gain for drive in found for gain in drive.gains]
    lines = [
        "| planted | estimator | K holds, estimators alone | K holds, of what may be quoted | withheld though it holds |",
        "|---|---|---|---|---|",
    ]
    groups = {effect: (effect,) for effect in PLANTED} | {"any cause": tuple(PLANTED), "clean": ("clean",)}
    for label, effects in groups.items():
        for estimator in sorted({gain.estimator for gain in gains}):
            these = [gain for gain in gains if gain.effect in effects and gain.estimator == estimator]
            quoted = [gain for gain in these if gain.left]
            lost = sum(gain.holds and not gain.left for gain in these)
            shares = " | ".join(f"{sum(gain.holds for gain in some)}/{len(some)}" for some in (these, quoted))
            lines.append(f"| {label.replace('_', ' ')} | {estimator} | {shares} | {lost} |")
    alone, causes = (sum(drive.cpu[k] for drive in found) / max(2 * len(found), 1) for k in (0, 1))
    lines.append("")
    lines.append(f"CPU time a drive: {alone:.2f} s for the estimators, {causes:.2f} s for the causes")
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    return print_table("benchmarks.hidden_effects.averaged_gains", __doc__, 36, 7000, run, table, argv)


if __name__ == "__main__":
    sys.exit(main())
