"""The car, from pedal to acceleration: left alone where it does what it is asked, named where it does not."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis import masks
from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.sensing.kinematics import slope
from canid.models.diagnosis.vehicle import vehicle_block, vehicle_data, vehicle_search
from canid.models.diagnosis.vehicle.vehicle_block import VEHICLE, Vehicle
from canid.models.diagnosis.vehicle.vehicle_data import VehicleData
from canid.models.diagnosis.vehicle.vehicle_model import (
    LAG,
    STRENGTH,
    VehicleSeen,
    accel,
    drivable,
    with_effects,
)
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Effect
from canid.models.effects.vehicle.power_limit import SOLD_FROM
from canid.values.findings import Verdict
from canid.values.types import Trace
from tests import seeds
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace
from tests.plants.outside_cars import Car, PedalMotion, Sensors, car_drive
from tests.seeds import mostly

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}
BY = {effect.id: effect for effect in CATALOGUE}


def drive(
    simulator: str,
    effects: dict[str, dict[str, float]],
    seed: int,
    profile: str = "mixed",
    noise: str = "ar1",
) -> Trace:
    return trace(PLANTS[simulator](effects, seed=seed, minutes=7, noise=noise, profile=profile))


def diagnosed(seen: Trace, catalogue: tuple[Effect, ...] = VEHICLE) -> Vehicle:
    return vehicle_block.diagnose_vehicle(seen, masks.recognise(seen)[0], catalogue)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
@pytest.mark.parametrize(
    ("profile", "noise", "seed"),
    seeds.in_turn(
        [("mixed", "white", 61), ("urban", "state", 62), ("motorway", "ar4", 63), ("urban", "resonant", 64)],
        2,
        "a car like others",
    ),
)
def test_a_car_like_others_is_not_blamed(simulator: str, profile: str, noise: str, seed: int) -> None:
    """Rolling country, a slightly bent map, an idling engine's drag and its rated power are what every car has."""
    vehicle = diagnosed(drive(simulator, {}, seed, profile, noise))
    assert not vehicle.findings, vehicle.block.says
    assert vehicle.block.state == "adequate"


@pytest.mark.slow("diagnoses planted drives")
def test_the_fitted_numbers_are_the_cars() -> None:
    planted = plant_one.plant({}, seed=65, minutes=10, noise="ar1", profile="mixed")
    vehicle = diagnosed(trace(planted))
    assert vehicle.cars is not None
    q, car = vehicle.cars[1].fitted.q, planted.truth["car"]
    assert q[STRENGTH] == pytest.approx(car["power"], rel=0.05)
    assert q[LAG] == pytest.approx(car["lag"], abs=0.1)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("simulator", "effect", "parameters", "seed", "profile", "within"),
    seeds.in_turn(
        [
            ("one", "pedal_map", {"curvature": 0.5}, 71, "mixed", 0.15),
            ("two", "pedal_map", {"curvature": 0.5}, 72, "urban", 0.4),  # a power law: another form
            ("one", "power_limit", {"power": 21.0}, 73, "mixed", 0.1),
            ("two", "power_limit", {"power": 5.5}, 74, "urban", 0.1),
            ("one", "road_grade", {"sd": 3.5}, 75, "motorway", 0.4),  # a sum of waves has its own spread
            ("two", "road_grade", {"sd": 4.0}, 76, "mixed", 0.4),
            ("two", "turbo_lag", {"tau": 1.0}, 77, "urban", 0.5),
            # at once, without the engine's lag
            ("one", "engine_braking", {"strength": 0.5}, 78, "motorway", 0.6),
            # fades with the pedal and with speed
            ("two", "engine_braking", {"strength": 0.7}, 79, "mixed", 0.6),
            ("two", "gear_ratio", {"share": 0.18}, 2009, "urban", 0.6),
        ],
        2,
        "planted cause",
    ),
)
def test_a_planted_cause_is_named_with_its_size(
    simulator: str, effect: str, parameters: dict[str, float], seed: int, profile: str, within: float
) -> None:
    vehicle = diagnosed(drive(simulator, {effect: parameters}, seed, profile))
    found = [f for f in vehicle.findings if effect in (f.effect, *f.rivals)]
    assert found, vehicle.block.says
    assert found[0].evidence > found[0].needed
    assert found[0].gain.low > 0
    if found[0].effect == effect:
        for name, value in parameters.items():
            iv = found[0].parameters[name]
            assert iv.low <= iv.value <= iv.high
            assert iv.value == pytest.approx(value, rel=within)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
def test_an_engine_that_cars_are_sold_with_is_no_cause(simulator: str) -> None:
    """The same limit of power names itself where it is a lorry's, and nowhere near a passenger car's."""
    strong = diagnosed(drive(simulator, {"power_limit": {"power": SOLD_FROM + 8}}, 81, "motorway"))
    assert not strong.findings, strong.block.says


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
def test_a_steady_wind_is_never_named_but_told_as_untold(simulator: str) -> None:
    vehicle = diagnosed(drive(simulator, {"headwind": {"speed": 10.0}}, 82, "motorway"))
    assert not vehicle.findings
    assert any("headwind" in one.effects for one in vehicle.not_testable)
    assert any("mass" in one.effects for one in vehicle.not_testable)


@pytest.mark.slow("diagnoses planted drives")
def test_without_a_measured_slope_a_hilly_road_gets_no_name() -> None:
    seen = drive("one", {"road_grade": {"sd": 3.0}}, 83, "mixed")
    blind = seen._replace(
        signals={role: x for role, x in seen.signals.items() if role not in ("grade", "altitude")}
    )
    vehicle = diagnosed(blind)
    assert not any(finding.effect == "road_grade" for finding in vehicle.findings)
    assert any({"road_grade", "headwind"} <= set(one.effects) for one in vehicle.not_testable)


@pytest.mark.slow("diagnoses planted drives")
def test_a_cause_that_is_not_in_the_catalogue_is_not_replaced_by_its_neighbour_alone() -> None:
    """Without the power limit its neighbour, the bent map, is named only if its car leaves nothing behind."""
    catalogue = tuple(effect for effect in VEHICLE if effect.id != "power_limit")
    vehicle = diagnosed(drive("one", {"power_limit": {"power": 20.0}}, 73, "motorway"), catalogue)
    assert vehicle.block.state == "unexplained", vehicle.block.says
    assert all(finding.surrogate for finding in vehicle.findings)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("seed", [900, 901])
def test_the_cars_own_lag_is_no_second_one(seed: int) -> None:
    """On hills the car's lag was fitted at 0 before the slope was in the model, and a second lag then stood for it."""
    hidden = {"road_grade": {"sd": 4.0}, "engine_braking": {"strength": 0.5}}
    planted = PLANTS["one"](hidden, seed=seed, minutes=8, noise="ar1", profile="mixed")
    named = {finding.effect for finding in diagnosed(trace(planted)).findings}
    assert "actuator_lag" not in named
    assert "road_grade" in named


@pytest.mark.slow("diagnoses planted drives")
def test_a_bent_map_is_the_verdict_of_the_whole_and_the_driver_is_not_blamed() -> None:
    report = diagnose(drive("one", {"pedal_map": {"curvature": 0.6}}, 84))
    assert report.verdict in (Verdict.NAMED, Verdict.ONE_OF)
    assert "in the vehicle" in report.says.lower()
    assert [finding.where for finding in report.findings] == ["vehicle"]
    assert [(block.where, block.state) for block in report.blocks] == [
        ("sensing", "adequate"), ("vehicle", "wrong"), ("driver", "adequate"),
        ("remnant", "adequate"),
    ]  # fmt: skip


@pytest.mark.slow("diagnoses planted drives")
def test_a_drive_without_pedal_says_what_to_map() -> None:
    seen = drive("one", {}, 85)
    vehicle = diagnosed(seen._replace(output=seen.signals["accel"]))
    assert vehicle.block.state == "not_testable"
    assert "pedal" in vehicle.block.says
    assert vehicle.cars is None


@pytest.mark.slow("diagnoses planted drives")
@mostly(0.95)
def test_a_pedal_that_moves_no_car_leaves_the_vehicle_untested(seed: int) -> None:
    """The pedal of another time, as where cruise control drove: nothing is called adequate."""
    seen = drive("one", {}, seed)
    shift = seen.t.size // 3
    assert diagnosed(seen).block.state == "adequate"
    other = seen._replace(
        output=np.roll(seen.output, shift),
        signals=seen.signals | {"pedal": np.roll(seen.signals["pedal"], shift)},
    )
    assert diagnosed(other).block.state != "adequate"


@pytest.mark.parametrize(
    "names", [(), ("pedal_map",), ("turbo_lag", "gear_ratio"), ("engine_braking", "power_limit")]
)
def test_the_car_step_by_step_is_the_car_all_at_once(names: tuple[str, ...]) -> None:
    rng, dt, n = np.random.default_rng(3), 0.1, 300
    effects = tuple(BY[name] for name in names)
    typical = [parameter.typical for effect in effects for parameter in effect.parameters]
    q = np.array([0.04, 0.35, 0.2, 3e-4, *typical])
    pedal = 15 + np.cumsum(rng.normal(0, 1.0, n)).clip(-15, 40)
    seen = VehicleSeen(
        dt * np.arange(n),
        pedal,
        20 + np.cumsum(rng.normal(0, 0.05, n)),
        np.zeros(n),
        rng.integers(1, 7, n).astype(float),
    )
    model = with_effects(effects)
    car, out = drivable(model, q, dt), []
    state = car.init(pedal[0])
    for k in range(n):
        state, a = car.step(state, pedal[k], seen.speed[k], 0.0, seen.gear[k])
        out.append(float(a))
    # the first samples differ: at once begins from rest, step by step as if the pedal had stood there
    np.testing.assert_allclose(out[100:], accel(model, seen, q, dt)[100:], atol=1e-6)


@pytest.mark.long("searches drives for causes")
def test_the_slope_of_the_speed_does_not_change_the_car() -> None:
    """A car that answers at once, by a rough pedal: its strength and no lag, from the speed alone.

    Without the same slope in the model, strength is 0.02 to 0.03 m/s² per % and the lag 0.3 s.
    """
    seen = car_drive(43, Car(), PedalMotion(4.0, 0.5), Sensors(speed_noise=0.03), 240.0)
    data = vehicle_data.prepare(seen, np.ones(seen.t.size, dtype=bool))
    assert isinstance(data, VehicleData)
    assert data.signal == "speed"
    fitted = vehicle_search.baseline(data)
    assert fitted is not None
    sd = vehicle_search.standard_errors(fitted, data.output.dt)
    assert abs(fitted.q[STRENGTH] - 0.04) < max(4 * sd[STRENGTH], 0.0006)
    assert fitted.q[LAG] < 0.02


def test_a_recorded_acceleration_passes_no_filter() -> None:
    """What was measured is compared with what the car does, to the last bit."""
    seen = car_drive(44, sensors=Sensors(accel=True), seconds=60.0)
    data = vehicle_data.prepare(seen, np.ones(seen.t.size, dtype=bool))
    assert isinstance(data, VehicleData)
    own = np.sin(seen.t)
    assert data.as_measured(own) is own


def test_the_model_passes_the_slope_that_the_speed_has_passed() -> None:
    """The slope of a speed of known acceleration is what the model makes of that acceleration."""
    seen = car_drive(45, sensors=Sensors(speed_noise=0.0), seconds=60.0)
    data = vehicle_data.prepare(seen, np.ones(seen.t.size, dtype=bool))
    assert isinstance(data, VehicleData)
    # of a polynomial both are known: speed t³, acceleration 3 t²
    t = seen.t - seen.t[0]
    made, right = data.as_measured(3.0 * t**2), slope(t**3, seen.dt)
    # straight lines between samples miss a parabola by dt² / 2
    assert np.abs(made - right)[5:-5].max() < 0.51 * seen.dt**2


@pytest.mark.slow("diagnoses drives of an outside simulator")
@pytest.mark.parametrize(("lag", "rough"), [(0.0, True), (0.0, False), (0.3, True)])
@mostly(0.95)
def test_no_cause_is_named_because_the_acceleration_is_a_slope(lag: float, rough: bool, seed: int) -> None:
    """Cars without a fault have none where only their speed was recorded, and are as strong as they are."""
    car = Car(lag, 0.12, 30.0, 4e-4, period=0.05)
    seen = car_drive(seed, car, PedalMotion(4.0, 1.0, rough), Sensors(20.0, 0.01))
    vehicle = diagnosed(seen)
    assert vehicle.findings == ()
    assert vehicle.cars is not None
    assert vehicle.cars[1].q[STRENGTH] == pytest.approx(car.strength, rel=0.02)


@pytest.mark.slow("diagnoses drives of an outside simulator")
@pytest.mark.parametrize(
    ("effect", "car"),
    [("turbo_lag", Car(0.2, low_load_lag=0.6)), ("pedal_map", Car(curvature=0.3))],
)
@mostly(0.95)
def test_a_planted_cause_is_found_from_the_speed_alone(effect: str, car: Car, seed: int) -> None:
    """The slope hides no cause that the car has."""
    found = diagnosed(car_drive(seed, car, PedalMotion(3.0))).findings
    assert effect in {finding.effect for finding in found}
