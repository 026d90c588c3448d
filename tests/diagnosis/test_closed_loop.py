"""Driver and car behind the lead of the log, on stretches that fitted neither: the true cause gains there too."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.driver import closed_loop, held_out
from canid.models.diagnosis.driver.driver_data import prepare
from canid.models.diagnosis.driver.driver_fit import baseline
from canid.models.diagnosis.driver.driver_model import BASE, with_effects
from canid.models.diagnosis.driver.driver_simulation import Late, SimulatedDriver, driver
from canid.models.diagnosis.several_drives.joined_drives import join
from canid.models.diagnosis.vehicle import vehicle_block
from canid.models.effects import CATALOGUE
from canid.values.findings import Report, Trajectory
from canid.values.types import Trace
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}
BY = {effect.id: effect for effect in CATALOGUE}


def drive(simulator: str, effects: dict[str, dict[str, float]], seed: int, profile: str) -> Trace:
    return trace(PLANTS[simulator](effects, seed=seed, minutes=6, noise="white", profile=profile))


def rms(of: Trajectory, simulated: np.ndarray) -> float:
    here = np.isfinite(simulated)
    return float(np.sqrt(np.mean((simulated - of.measured)[here] ** 2)))


def roles(report: Report) -> dict[str, Trajectory]:
    return {of.role: of for of in report.closed_loop}


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(("simulator", "seed"), [("one", 95), ("two", 92)])
def test_a_clean_drive_is_driven_again_within_metres(simulator: str, seed: int) -> None:
    """The simulated gap errs by little of what the gap moves, and where nothing was found nothing is gained."""
    seen = drive(simulator, {}, seed, "mixed")
    report = diagnose(seen)
    loop = roles(report)
    assert set(loop) == {"gap", "speed"}
    for of in loop.values():
        there = np.isfinite(of.before)
        assert there.sum() > 0.3 * there.size
        assert rms(of, of.before) < 0.15 * float(np.std(of.measured[there]))
        assert np.array_equal(of.before, of.after, equal_nan=True)
        assert np.isnan(of.gain.value)
    braking = np.nan_to_num(seen.signals["brake"]) > 0.5
    assert not np.isfinite(loop["gap"].before[braking]).any()


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize(
    ("simulator", "effect", "parameters", "profile", "seed"),
    [
        ("one", "looming_gain", {"exponent": 1.0}, "urban", 93),
        ("two", "gain_change", {"share": 0.5, "time": 180.0}, "mixed", 94),
    ],
)
def test_a_named_cause_brings_gap_and_speed_nearer_to_what_was_measured(
    simulator: str, effect: str, parameters: dict[str, float], profile: str, seed: int
) -> None:
    report = diagnose(drive(simulator, {effect: parameters}, seed, profile))
    assert effect in {name for f in report.findings for name in (f.effect, *f.rivals)}, report.says
    for of in report.closed_loop:
        assert rms(of, of.after) < rms(of, of.before)
        assert 0 < of.gain.low < of.gain.value < of.gain.high < 1
        # the gain is that of the trajectories that are shown
        assert of.gain.value == pytest.approx(1 - (rms(of, of.after) / rms(of, of.before)) ** 2, abs=1e-9)


@pytest.mark.slow("diagnoses planted drives")
def test_an_output_that_is_the_acceleration_is_integrated() -> None:
    """No car is needed: gap and speed follow from the driver's acceleration alone."""
    seen = drive("one", {}, 95, "mixed")
    signals = {role: x for role, x in seen.signals.items() if role not in ("pedal", "brake")}
    report = diagnose(seen._replace(output=seen.signals["accel"], signals=signals))
    assert report.output == "accel"
    assert report.blocks[1].state == "not_testable"
    loop = roles(report)
    for of in loop.values():
        assert rms(of, of.before) < 0.3 * float(np.std(of.measured[np.isfinite(of.before)]))
    gap, speed = loop["gap"].before, loop["speed"].before
    dt = float(report.t[1] - report.t[0])
    # gap and speed belong together: the gap's change is the lead's speed less the own
    known = np.isfinite(gap[1:]) & np.isfinite(gap[:-1])
    lead = loop["speed"].measured + seen.signals["range_rate"][:: round(dt / seen.dt)][: gap.size]
    mean = 0.5 * (lead[1:] + lead[:-1] - speed[1:] - speed[:-1])
    within = known & (gap[1:] > 1.0)
    # the stretches' beginnings are set, not simulated
    assert np.median(np.abs(np.diff(gap)[within] / dt - mean[within])) < 1e-6


@pytest.mark.slow("diagnoses planted drives")
def test_a_command_and_a_pedal_without_a_fitted_car_are_no_closed_loop() -> None:
    seen = drive("one", {}, 95, "mixed")
    everything = np.ones(seen.t.size, dtype=bool)
    data = prepare(seen, everything)
    unknown = vehicle_block.diagnose_vehicle(
        seen._replace(signals={role: x for role, x in seen.signals.items() if role != "speed"}), everything
    )
    assert unknown.cars is None
    for role in ("accel_command", "steering_angle", "", "pedal"):
        assert closed_loop.simulate(seen, data, role, (), (), unknown) == ()


@pytest.mark.parametrize(
    "names",
    [(), ("looming_gain",), ("relative_speed_dead_zone", "gain_drift"), ("backlash",), ("second_lag",)],
)
def test_the_driver_in_the_loop_is_the_textbook_driver(names: tuple[str, ...]) -> None:
    """Step by step against Euler's method at a fiftieth of the step, on inputs that are given."""
    dt, fine, m = 0.1, 50, 2
    effects = tuple(BY[name] for name in names)
    model = with_effects(effects)
    q = np.zeros((len(model.low), m))
    numbers = {
        "offset": (9.0, 11.0), "K1": (5.0, 7.0), "K2": (6.0, 4.0), "tau1": (0.5, 0.8), "tau2": (0.4, 0.6),
        "dead_time1": (0.3, 0.45), "dead_time2": (0.25, 0.4), "headway_desired": (1.8, 2.1),
    }  # fmt: skip
    for name, values in numbers.items():
        q[BASE.index(name)] = values
    for effect, where in zip(effects, model.where, strict=True):
        for parameter, k in zip(effect.parameters, range(where.start, where.stop), strict=True):
            q[k] = parameter.typical
    past, n = 40, 240
    t = dt * np.arange(past + n)[:, None] + np.zeros(m)
    gap, rate, speed = 35 + 8 * np.sin(0.2 * t), 1.6 * np.cos(0.2 * t), 18 + 2 * np.sin(0.13 * t)
    late = Late(gap, rate, speed, np.zeros_like(t), t)
    still = np.zeros((past + n, m))
    init, step = driver(
        SimulatedDriver(model, q, (np.zeros(m), np.zeros(m)), still, still > 0, np.inf, 30.0), dt
    )
    state, out = init(), []
    for k in range(past, past + n):
        state, demand = step(state, late, k)
        out.append(demand)
    got = np.array(out)
    for j in range(m):
        expected = textbook(
            names, {name: values[j] for name, values in numbers.items()}, past * dt, n, dt, fine
        )
        # begun empty; after some lags the begin is forgotten
        np.testing.assert_allclose(got[60:, j], expected[60:], atol=0.12)


def textbook(
    names: tuple[str, ...], q: dict[str, float], begin: float, n: int, dt: float, fine: int
) -> np.ndarray:
    h, y1, y2, slow, held, out = dt / fine, 0.0, 0.0, None, None, []
    for k in range(n * fine):
        t = begin + k * h
        a, b = t - q["dead_time1"], t - q["dead_time2"]
        e = (35 + 8 * np.sin(0.2 * a)) / (18 + 2 * np.sin(0.13 * a)) - q["headway_desired"]
        w, gain = 1.6 * np.cos(0.2 * b), 1.0
        if "looming_gain" in names:
            w *= (30.0 / (35 + 8 * np.sin(0.2 * b))) ** BY["looming_gain"].parameters[0].typical
        if "relative_speed_dead_zone" in names:
            width = BY["relative_speed_dead_zone"].parameters[0].typical
            w = np.sign(w) * max(abs(w) - width, 0.0)
        if "gain_drift" in names:
            gain = 1 + BY["gain_drift"].parameters[0].typical * (t / 30.0 - 0.5)
        demand = q["offset"] + y1 + y2
        if "second_lag" in names:
            slow = (
                demand
                if slow is None
                else slow + h / BY["second_lag"].parameters[0].typical * (demand - slow)
            )
            demand = slow
        if "backlash" in names:
            half = 0.5 * BY["backlash"].parameters[0].typical
            held = demand if held is None else min(max(held, demand - half), demand + half)
            demand = held
        if k % fine == 0:
            out.append(demand)
        y1 += h / q["tau1"] * (gain * q["K1"] * e - y1)
        y2 += h / q["tau2"] * (gain * q["K2"] * w - y2)
    return np.array(out)


@pytest.mark.slow("fits a planted drive")
@pytest.mark.parametrize(("simulator", "seed"), [("one", 1521001), ("two", 1521002)])
def test_the_simulated_lead_accelerates_when_the_lead_did(simulator: str, seed: int) -> None:
    """A driver who responds to the lead's acceleration responds to that of the simulated lead, not to a late estimate."""
    planted = PLANTS[simulator]({}, seed=seed, minutes=6, noise="white", profile="mixed")
    seen = trace(planted)
    signals = {role: x for role, x in seen.signals.items() if role not in ("pedal", "brake")}
    data = prepare(
        seen._replace(output=seen.signals["accel"], signals=signals), np.ones(seen.t.size, dtype=bool)
    )
    fitted = baseline(data)
    assert fitted is not None
    where = closed_loop.stretches(data.output.usable, data.output.dt)
    road = closed_loop.Road(data, data.seen.speed + data.seen.range_rate, data.output.y)
    driven = closed_loop.driven(road, closed_loop.Ride((fitted,), (None,), (), None), where)
    columns = planted.columns
    lead = np.gradient(columns["speed"] + columns["range_rate"], planted.dt)
    true = np.interp(seen.t, columns["t"], lead)
    for m, stretch in enumerate(where):
        there = true[stretch.start : stretch.stop]
        here = driven.late.lead_accel[driven.past : driven.past + there.size, m]
        late = [float(np.corrcoef(here[k:], there[: there.size - k])[0, 1]) for k in range(5)]
        assert int(np.argmax(late)) <= 1, late
    every = np.concatenate([true[stretch.start : stretch.stop] for stretch in where])
    simulated = np.concatenate(
        [driven.late.lead_accel[driven.past : driven.past + s.stop - s.start, m] for m, s in enumerate(where)]
    )
    assert np.std(simulated - every) < 0.4 * np.std(every)


def test_stretches_lie_in_the_folds_that_did_not_fit_their_driver() -> None:
    usable = np.ones(2000, dtype=bool)
    usable[350:420] = False
    found = closed_loop.stretches(usable, 0.1)
    for one in found:
        block = round(held_out.FOLD_BLOCK_S / 0.1)
        assert one.start // block == (one.stop - 1) // block == one.block
        assert usable[one.start : one.stop].all()
    assert [one.block for one in found] == [0, 1, 2, 3, 4, 5, 6]
    assert closed_loop.stretches(np.zeros(2000, dtype=bool), 0.1) == ()


@pytest.mark.slow("diagnoses planted drives")
def test_an_unstable_driver_leaves_numbers() -> None:
    """Answers of the wrong sign fly apart: the error is large and finite, and nothing overflows."""
    seen = drive("one", {}, 95, "mixed")
    signals = {role: x for role, x in seen.signals.items() if role not in ("pedal", "brake")}
    data = prepare(
        seen._replace(output=seen.signals["accel"], signals=signals), np.ones(seen.t.size, dtype=bool)
    )
    fitted = baseline(data)
    assert fitted is not None
    effect = BY["speed_gain"]
    model = with_effects((effect,))
    q = np.concatenate([fitted.q, [4.0]])
    q[[BASE.index("K1"), BASE.index("K2")]] = -50.0, -50.0
    where = closed_loop.stretches(data.output.usable, data.output.dt)
    ride = closed_loop.Ride(
        (fitted._replace(model=model, fitted=fitted.fitted._replace(q=q)),), (None,), (), None
    )
    road = closed_loop.Road(data, data.seen.speed + data.seen.range_rate, data.output.y)
    for simulated in closed_loop.drive(road, ride, where):
        known = simulated[where[0].start : where[0].stop]
        assert np.isfinite(known).all()
        assert np.ptp(known) > 20


@pytest.mark.slow("fits a driver and a car")
def test_a_stretch_after_a_hole_in_the_log_is_driven() -> None:
    """Between two drives there is no output, nor in an interrupted log: the engine's lags do not begin with it."""
    drives = [
        trace(plant_one.plant({}, seed=seed, minutes=1.5, noise="white", profile="mixed")) for seed in (5, 6)
    ]
    joined = join(drives).trace
    usable = np.isfinite(joined.output)
    vehicle = vehicle_block.diagnose_vehicle(joined, usable)
    data = prepare(joined, usable)
    fitted = baseline(data)
    assert fitted is not None
    assert vehicle.cars is not None
    nowhere = np.zeros(joined.t.size, dtype=bool)
    car = closed_loop.car(vehicle.cars[0], vehicle, fitted.fitted.model, nowhere, joined.dt)
    first = joined.t.size - drives[1].t.size
    assert np.isnan(joined.output[first - 1])
    road = closed_loop.Road(data, data.seen.speed + data.seen.range_rate, joined.output)
    here = closed_loop.Stretch(first, first + 300, 0)
    driven = closed_loop.driven(road, closed_loop.Ride((fitted,), (None,), (), car), (here,))
    assert np.isfinite(driven.output[driven.past : -1]).all()
    assert np.isfinite(driven.late.gap).all()
