"""Do the driver's intervals hold where an effect was there and was not named?

    python -m benchmarks.hidden_effects.missed [--drives 90] [--first-seed 1000] [--workers 1]

A third of the drives is clean, a third has an answer to the lead's acceleration, a third another effect, all weak. Shown are
the shares of intervals with the truth inside: by the final model alone (its covariance, as `model` in the JSON report
states it), and as reported, averaged over the models that the drive does not exclude.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

import canid
from benchmarks.hidden_effects.drawn_drives import print_table
from canid.mathematics.identification.confidence import SIGMAS
from canid.values.types import Interval
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

# effect -> parameter, and strengths between which it is drawn; a pedal's
WEAK = {
    "lead_acceleration": ("gain", 1.0, 6.0),
    "relative_speed_dead_zone": ("width", 0.05, 0.3),
    "asymmetric_gain": ("share", 0.05, 0.25),
    "looming_gain": ("exponent", 0.08, 0.3),
}
# parameter -> names of those in the model whose sum it is, and the factor of its intervals (docs/evidence/diagnosis.md)
PARAMETERS = {
    "K1": (("K1",), 1.1),
    "K2": (("K2",), 1.1),
    "τ2": (("tau2",), 1.3),
    "θ2": (("dead_time2",), 1.3),
    "τ2+θ2": (("tau2", "dead_time2"), 1.3),
}


class Outcome(NamedTuple):
    """One drive."""

    effect: str  # "": clean
    verdict: str
    truth: dict[str, float]
    alone: dict[str, Interval]  # by the final model alone
    reported: dict[str, Interval]


def run(seed: int) -> Outcome | None:
    """Draw a drive and diagnose it; None: no model in the report."""
    rng = np.random.default_rng(seed)
    names = tuple(WEAK)
    effect = ("", names[0], str(rng.choice(names[1:])))[seed % 3]
    given = {effect: {WEAK[effect][0]: float(rng.uniform(*WEAK[effect][1:]))}} if effect else {}
    plant, profile = ((plant_one, "mixed"), (plant_two, "urban"))[int(rng.integers(2))]
    noise, minutes = str(rng.choice(("white", "ar1", "mix"))), float(rng.choice((6.0, 10.0)))
    planted = plant.plant(given, seed=seed, minutes=minutes, noise=noise, profile=profile)
    report = canid.diagnose(trace(planted))
    if report.model is None:
        return None
    d = planted.truth["driver"]
    truth = {"K1": d["K1"], "K2": d["K2"], "tau2": d["tau2"], "dead_time2": d["dead_time2"]}
    headway, rate = (report.extended.channels[name] for name in ("headway_error", "range_rate"))
    reported = (headway.K, rate.K, rate.tau, rate.dead_time, rate.tau_plus_dead_time)
    alone = {}
    for name, (parts, wider) in PARAMETERS.items():
        index = [report.model.names.index(part) for part in parts]
        half = SIGMAS * wider * float(np.sqrt(report.model.covariance[np.ix_(index, index)].sum()))
        value = sum(report.model.driver[part] for part in parts)
        low = value - half if name.startswith("K") else max(value - half, 0.0)
        alone[name] = Interval(value, low, value + half)
    true = {name: sum(truth[part] for part in parts) for name, (parts, _) in PARAMETERS.items()}
    return Outcome(effect, report.verdict.value, true, alone, dict(zip(PARAMETERS, reported, strict=True)))


def table(outcomes: Sequence[Outcome]) -> list[str]:
    """The table, in Markdown: rows are kinds of drives, cells "final model alone → as reported, times the width"."""
    lines = [f"| drives | | {' | '.join(PARAMETERS)} |", f"|---|---|{'---|' * len(PARAMETERS)}"]
    silent = [one for one in outcomes if one.verdict == "adequate"]
    rows = {
        "named": [one for one in outcomes if one.verdict == "named"],
        "adequate, clean": [one for one in silent if not one.effect],
        "adequate, `lead_acceleration` missed": [one for one in silent if one.effect == "lead_acceleration"],
        "adequate, another effect missed": [
            one for one in silent if one.effect not in ("", "lead_acceleration")
        ],
    }
    rows["all of these"] = [one for of in rows.values() for one in of]
    for title, of in rows.items():
        lines.append(f"| {title} | {len(of)} | {' | '.join(cell(of, name) for name in PARAMETERS)} |")
    return lines


def cell(of: Sequence[Outcome], name: str) -> str:
    """Shares inside by both intervals, and the median ratio of their widths."""
    if not of:
        return ""
    inside = [
        [each[name].low <= one.truth[name] <= each[name].high for each in (one.alone, one.reported)]
        for one in of
    ]
    ratio = [
        (one.reported[name].high - one.reported[name].low) / (one.alone[name].high - one.alone[name].low)
        for one in of
    ]
    alone, reported = ([flags[k] for flags in inside] for k in (0, 1))
    return f"{np.mean(alone):.2f} → {np.mean(reported):.2f}, × {np.median(ratio):.2f}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the table."""
    return print_table("benchmarks.hidden_effects.missed", __doc__, 90, 1000, run, table, argv)


if __name__ == "__main__":
    sys.exit(main())
