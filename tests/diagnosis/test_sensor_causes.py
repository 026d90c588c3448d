"""What a sensor does is no cause of driver or car."""

from __future__ import annotations

import numpy as np
import pytest

import canid
from tests.plants.outside_drives import drawn_drive
from tests.plants.quoted_intervals import trace
from tests.plants.sensor_effects import EFFECTS, Drawn, applied

# simulator, seed, effect and strength; nothing is planted in driver or car
CASES = (
    ("acceleration", 47_000, "steps of the gap", 2.0),
    ("Helly", 47_003, "output held", 1.0),
    ("Helly", 47_003, "output joined by lines", 1.0),
)


@pytest.mark.slow("diagnoses drives of ten minutes")
@pytest.mark.parametrize(("simulator", "seed", "name", "strength"), CASES)
def test_no_cause_is_named_because_of_a_sensor(simulator: str, seed: int, name: str, strength: float) -> None:
    place = next(k for k, effect in enumerate(EFFECTS) if effect.name == name)
    rng = np.random.default_rng([seed, place + 1])
    drive = applied(drawn_drive(simulator, seed), (Drawn(EFFECTS[place], strength),), rng)
    report = canid.diagnose(trace(drive), arbitrated=False)
    assert [each.effect for each in report.findings if each.where in ("driver", "vehicle")] == []
