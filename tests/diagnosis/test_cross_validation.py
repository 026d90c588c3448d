"""A cause chosen by chance gains nothing on held-out data; a true cause gains nearly all of its evidence there."""

from __future__ import annotations

import numpy as np
import pytest

from canid.diagnosis.driver import driver_candidates, held_out
from canid.diagnosis.driver.driver_data import prepare
from canid.diagnosis.driver.driver_fit import baseline
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.fitting.search import Named
from canid.effects import CATALOGUE
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

(GAIN_CHANGE,) = (effect for effect in CATALOGUE if effect.id == "gain_change")


def fitted(plant: object, strength: dict[str, float] | None) -> Search:
    """A search that ended with `gain_change`, right or wrong."""
    effects = {} if strength is None else {"gain_change": strength}
    planted = plant(effects, seed=47, minutes=8, noise="ar1", profile="mixed")  # type: ignore[operator]
    measured = trace(planted)
    data = prepare(measured, np.ones(measured.t.size, dtype=bool))
    before = baseline(data)
    assert before is not None
    begins = driver_candidates.screen(GAIN_CHANGE, data, before)
    found = driver_candidates.tried(GAIN_CHANGE, data, before, begins)
    named = (Named(GAIN_CHANGE, found.evidence, 20.0, ()),)
    return Search(before, data, found.solved, named, (), None, ())


@pytest.mark.parametrize("plant", [plant_one.plant, plant_two.plant])
def test_what_chance_chose_does_not_carry_over(plant: object) -> None:
    of = fitted(plant, None)
    assert held_out.carried(of, GAIN_CHANGE) < 3.0


@pytest.mark.parametrize("plant", [plant_one.plant, plant_two.plant])
def test_a_true_cause_carries_over(plant: object) -> None:
    of = fitted(plant, {"share": 0.5, "time": 200.0})
    assert of.named[0].evidence > 30.0
    assert held_out.carried(of, GAIN_CHANGE) > 0.5 * of.named[0].evidence
