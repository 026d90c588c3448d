"""How often does a cause that is not there gain surely on held-out data?

    python -m benchmarks held_out_null [--drives 20] [--first-seed 200] [--workers 1]

Clean drives of 8 min of both planting simulators. Each effect that is fitted is fitted to each drive, as the search does,
and its gain on held-out data is taken as the diagnosis takes it: in one-step log score, and of the simulation's error
variance. Shown is how often the interval lies above 0; nominal 2.5 %.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

from benchmarks.hidden_effects.drawn_drives import print_table
from canid.models.diagnosis.driver import driver_candidates, driver_search, held_out
from canid.models.diagnosis.driver.driver_data import prepare
from canid.models.diagnosis.driver.driver_fit import baseline
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.null import predictive_score
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect, Kind
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

NOISES = ("white", "ar1", "mix")
# of a simulator each: the roads on which its drivers show most
PLANTS = ((plant_one, "mixed"), (plant_two, "urban"))

Outcome = dict[str, tuple[bool, bool]]  # effect -> surely above 0 in log score, and in simulation


def fitted_effects() -> tuple[Effect, ...]:
    """Effects of the driver that the search fits."""
    return tuple(
        effect
        for effect in CATALOGUE
        if effect.where == "driver" and effect.kind is Kind.PARAMETRIC and effect.identifiable
    )


def run(seed: int) -> Outcome | None:
    """Fit every effect to a clean drive; None: no baseline."""
    plant, profile = PLANTS[seed % 2]
    noise = NOISES[seed % 3]
    measured = trace(plant.plant({}, seed=seed, minutes=8, noise=noise, profile=profile))
    data = prepare(measured, np.ones(measured.t.size, dtype=bool))
    before = baseline(data)
    if before is None:
        return None
    out = {}
    for effect in fitted_effects():
        found = driver_candidates.tried(effect, data, before, driver_candidates.screen(effect, data, before))
        search = Search(before, data, found.solved, (Named(effect, found.evidence, 0.0),))
        folds = held_out.folds(data, search, driver_search.again)
        score = predictive_score.of_whole(data, search, folds, before.noise.size)
        out[effect.id] = score.low > 0, held_out.simulation_gain(data, search, folds).low > 0
    return out


def table(outcomes: Sequence[Outcome]) -> list[str]:
    """The table: effect by effect, and all together."""
    lines = ["| effect | drives | surely above 0: log score | simulation |", "|---|---|---|---|"]
    sums = np.zeros(2, dtype=int)
    for effect in fitted_effects():
        counts = np.sum([one[effect.id] for one in outcomes], axis=0)
        sums += counts
        lines.append(f"| {effect.id} | {len(outcomes)} | {counts[0]} | {counts[1]} |")
    n = len(outcomes) * len(fitted_effects())
    share = [f"{count} ({100 * count / max(n, 1):.1f} %)" for count in sums]
    return [*lines, f"| all | {n} | {share[0]} | {share[1]} |"]


if __name__ == "__main__":
    sys.exit(print_table("benchmarks.hidden_effects.held_out_null", __doc__, 20, 200, run, table, None))
