"""What a sensor does is no cause of driver or car."""

from __future__ import annotations

import numpy as np
import pytest

import canid
from canid.models.diagnosis import corrections
from canid.models.diagnosis.driver import pedal_holds
from canid.models.diagnosis.vehicle import pedal_record
from canid.models.effects import CATALOGUE
from tests.plants.outside_drives import Drive, drawn_drive
from tests.plants.quoted_intervals import trace
from tests.plants.sensor_effects import EFFECTS, OUTPUT, Drawn, applied, limit
from tests.seeds import mostly

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


@pytest.mark.slow("diagnoses a drive of ten minutes")
def test_the_end_of_a_pedals_record_is_no_habit_of_the_driver(seed: int) -> None:
    """Where the car accelerates on; the driver's block is adequate, and the sensors' is not."""
    rng = np.random.default_rng(seed)
    drive = limit(drawn_drive("Helly", seed), 0.25, rng, role=OUTPUT, sides=(False, True))
    report = canid.diagnose(trace(drive))
    (ceiling,) = [each for each in report.findings if each.effect == "pedal_ceiling"]
    assert ceiling.where == "sensing", report.says
    assert {block.where: block.state for block in report.blocks}["driver"] == "adequate"
    assert "In the sensing: The pedal's record ends at" in report.says


@pytest.mark.slow("fits cars to drives of ten minutes")
@mostly(0.9)
def test_a_limiter_is_no_end_of_the_record(seed: int) -> None:
    """One level, as the end of a record and as that of the pedal itself: beyond a record the car accelerates on."""
    recorded = limit(
        drawn_drive("Helly", seed), 0.25, np.random.default_rng(seed), role=OUTPUT, sides=(False, True)
    )
    level = float(recorded.columns["pedal"].max())
    found = [_record_ends(each) for each in (recorded, drawn_drive("Helly", seed, limits=(0.0, level)))]
    assert found == [True, False]


def _record_ends(drive: Drive) -> bool:
    """Whether the residual of the car says so."""
    of = trace(drive)
    context = corrections.diagnose_context(of, CATALOGUE)
    since = of.t - of.t[0]
    spans = pedal_holds.standing(of.output >= of.output.max() - 0.01, of.dt)
    stands = [(float(since[a]), float(since[b - 1]) + of.dt) for a, b in spans]
    return pedal_record.ends(since, context.vehicle.left, stands)
