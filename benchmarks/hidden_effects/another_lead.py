"""Does the stated gain of a named cause hold on a fresh drive of the same driver, behind another lead?

    python -m benchmarks.hidden_effects.another_lead [--drives 40] [--first-seed 4000] [--workers 1]

A driver with a strong effect drives 10 min; where it is named, both models, as fitted to that drive, are simulated on two
more drives of the same driver: on the same kind of road and on another, with another car, lead and noise.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
from scipy.special import logit

from benchmarks.hidden_effects.drawn_drives import print_table
from canid.models.diagnosis import masks
from canid.models.diagnosis.driver import held_out
from canid.models.diagnosis.null import confirmed_search
from canid.models.diagnosis.prepared_drive import Prepared, ready
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Kind
from canid.values.types import Interval
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace
from tests.plants.planted_drive import Planted

DRIVERS = tuple(effect for effect in CATALOGUE if effect.where == "driver" and effect.kind is not Kind.MASK)
# effect -> parameter, and strengths between which it is drawn; a pedal's
STRONG = {
    "relative_speed_dead_zone": ("width", 0.4, 1.2),
    "asymmetric_gain": ("share", 0.3, 0.6),
    "looming_gain": ("exponent", 0.5, 1.2),
    "lead_acceleration": ("gain", 5.0, 10.0),
    "headway_dead_zone": ("width", 0.5, 1.0),
}
DRIVER = ("K1", "K2", "tau1", "tau2", "dead_time1", "dead_time2", "headway_desired", "offset")
ANOTHER = {"mixed": "urban", "urban": "mixed", "motorway": "mixed"}
MINUTES = 10.0
# from the seed of the first drive to those of the others
SAME_ROAD, OTHER_ROAD = 500_000, 600_000


class Outcome(NamedTuple):
    """One driver on three drives."""

    effect: str
    here: Interval  # gain on held-out data of the first drive, with the interval of a bootstrap
    same: float  # gain on the same kind of road
    other: float  # on another


def prepared(planted: Planted) -> Prepared | None:
    """The drive as a diagnosis fits it."""
    seen = trace(planted)
    return ready(seen, masks.recognise(seen, CATALOGUE)[0])


def run(seed: int) -> Outcome | None:
    """Draw a driver; None: his effect is not named on the first drive."""
    rng = np.random.default_rng(seed)
    effect = str(rng.choice(list(STRONG)))
    given = {effect: {STRONG[effect][0]: float(rng.uniform(*STRONG[effect][1:]))}}
    plant, road = (plant_one, plant_two)[int(rng.integers(2))], str(rng.choice(list(ANOTHER)))
    noise = str(rng.choice(("white", "ar1", "mix")))
    first = plant.plant(given, seed=seed, minutes=MINUTES, noise=noise, profile=road)
    of = prepared(first)
    if of is None:
        return None
    found = confirmed_search.cross_validated(of.data, DRIVERS, of.fitted)
    models = (found.search.baseline, found.search.solved)
    if effect not in {one.id for one in models[1].model.effects}:
        return None
    driver = {name: value for name, value in first.truth["driver"].items() if name in DRIVER}
    gains = []
    for away, profile in ((SAME_ROAD, road), (OTHER_ROAD, ANOTHER[road])):
        there = prepared(
            plant.plant(given, seed=seed + away, minutes=MINUTES, noise=noise, profile=profile, **driver)
        )
        if there is None:
            return None
        output = there.data.output
        used = output.usable & ~output.below
        before, after = (
            float(np.mean((output.y - one.model.bind(there.data)(one.q))[used] ** 2)) for one in models
        )
        gains.append(1.0 - after / before)
    return Outcome(effect, found.gain, gains[0], gains[1])


def table(outcomes: Sequence[Outcome]) -> list[str]:
    """The table, in Markdown."""
    lines = [
        "| on a fresh drive | inside, by a bootstrap over stretches | inside, as stated | spread of the log odds |",
        "|---|---|---|---|",
    ]
    for title, of in (
        ("same kind of road", [(one.here, one.same) for one in outcomes]),
        ("another kind", [(one.here, one.other) for one in outcomes]),
    ):
        narrow = [here.low <= fresh <= here.high for here, fresh in of]
        stated = [held_out.predicted(here) for here, _ in of]
        wide = [each.low <= fresh <= each.high for each, (_, fresh) in zip(stated, of, strict=True)]
        edge = held_out.LEAST
        odds = [
            [float(logit(np.clip(x, edge, 1.0 - edge))) for x in (fresh, here.value)] for here, fresh in of
        ]
        spread = float(np.sqrt(np.mean([(a - b) ** 2 for a, b in odds])))
        lines.append(f"| {title} | {sum(narrow)} of {len(of)} | {sum(wide)} of {len(of)} | {spread:.2f} |")
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Run the table."""
    return print_table("benchmarks.hidden_effects.another_lead", __doc__, 40, 4000, run, table, argv)


if __name__ == "__main__":
    sys.exit(main())
