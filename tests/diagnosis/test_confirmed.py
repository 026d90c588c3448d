"""What chance chose wins nothing on data that it did not fit; a true cause wins nearly all of its evidence there."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.hidden_effects import plant_one, plant_two
from benchmarks.hidden_effects.sensed import trace
from canid.diagnosis import held_out, search
from canid.diagnosis.driver_data import prepare
from canid.diagnosis.naming import Named, Search
from canid.diagnosis.solved import baseline
from canid.effects import CATALOGUE

(GAIN_CHANGE,) = (effect for effect in CATALOGUE if effect.id == "gain_change")


def fitted(plant: object, strength: dict[str, float] | None) -> Search:
    """A search that ended with `gain_change`, right or wrong."""
    effects = {} if strength is None else {"gain_change": strength}
    planted = plant(effects, seed=47, minutes=8, noise="ar1", profile="mixed")  # type: ignore[operator]
    measured = trace(planted)
    data = prepare(measured, np.ones(measured.t.size, dtype=bool))
    before = baseline(data)
    assert before is not None
    begins = search.screen(GAIN_CHANGE, data, before)
    found = search.tried(GAIN_CHANGE, data, before, begins)
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
