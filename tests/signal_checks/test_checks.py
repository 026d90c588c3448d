"""Each check finds the fault that it is for, by its name, and is silent without one."""

from __future__ import annotations

import numpy as np
import pytest

from canid.signals.signal_checks import own_motion, signal_checks
from canid.signals.signal_checks.check import UNIT_FACTORS, unit_of
from canid.values.types import Driver
from tests.seeds import mostly
from tests.signal_checks.synthetic import Array, Columns, changed, findings, following, samples, smooth

OTHERS = ("gnss_speed", "wheel_speed", "accel")


def held(x: Array) -> Array:
    """Every sixth value, repeated."""
    return np.repeat(x[::6], 6)[: len(x)]


def throttle(columns: Columns) -> Columns:
    """An idle controller moves it while the brake works."""
    pedal = np.maximum(columns["pedal"], 5.0 + np.sin(np.arange(len(columns["pedal"])) / 20.0))
    brake = ((np.arange(len(pedal)) // 60) % 4 == 0).astype(float)
    return {**columns, "pedal": pedal, "brake": brake}


def backwards(x: Array) -> Array:
    """What is of another object."""
    return x[::-1]


FAULTS = {
    "dead": ("range_rate_dead", changed("range_rate", lambda x: 0.0 * x), ()),
    "stopped": ("range_rate_frozen", changed("range_rate", lambda x: 0.0 * x + x[0], 0.5), ()),
    "sign": ("range_rate_sign", changed("range_rate", lambda x: -x), ()),
    "scale": ("range_rate_scale", changed("range_rate", lambda x: 3.6 * x), ()),
    "other object": ("gap_contradicts_range_rate", changed("range_rate", backwards), ()),
    "satellites": ("speed_unit", changed("speed", lambda x: 3.6 * x), ("wheel_speed", "accel")),
    "wheels": ("speed_unit", changed("speed", lambda x: x / 3.6), ("gnss_speed", "accel")),
    "acceleration": ("speed_unit", changed("speed", lambda x: 2.237 * x), ("gnss_speed", "wheel_speed")),
    "own motion": ("speed_unit", changed("speed", lambda x: 3.6 * x), OTHERS),
    "eighth too fast": ("speed_scale", changed("speed", lambda x: 1.12 * x), ("wheel_speed", "accel")),
    "speed stopped": ("speed_frozen", changed("speed", lambda x: 0.0 * x + x[0], 0.5), ()),
    "gap stopped": ("gap_frozen", changed("gap", lambda x: 0.0 * x + x[0], 0.5), ()),
    "held": ("range_rate_repeated", changed("range_rate", held), ()),
    "throttle": ("pedal_is_throttle", throttle, ()),
}


@pytest.mark.parametrize("fault", FAULTS)
@mostly(0.95)
def test_each_fault_is_found_by_its_name(fault: str, seed: int) -> None:
    """A planted fault is found, with a sentence, a time and a remedy, and withholds the estimates."""
    name, plant, without = FAULTS[fault]
    found = findings(plant(following(seed)), without=without)
    assert name in {one.name for one in found}, found
    one = next(one for one in found if one.name == name)
    assert one.withholds
    assert 0.0 <= one.since <= one.raised
    assert one.says
    assert one.remedy


@pytest.mark.parametrize("output", ["pedal", "accel"])
@mostly(0.95)
def test_sound_signals_are_left_alone(output: str, seed: int) -> None:
    """Nothing is found on a drive without a fault, whichever output is identified."""
    assert findings(following(seed), Driver(output=output)) == ()


@mostly(0.95)
def test_a_coarse_radar_is_no_held_one(seed: int) -> None:
    """Steps of 0.5 m and 0.25 m/s repeat values, and are no fault."""
    columns = following(seed)
    columns |= {
        name: np.rint(columns[name] / step) * step for name, step in (("gap", 0.5), ("range_rate", 0.25))
    }
    assert findings(columns) == ()


@pytest.mark.parametrize("step", [0.1, 0.125])
@mostly(0.95)
def test_a_coarse_radar_without_noise_is_no_held_one(step: float, seed: int) -> None:
    """It stands still where it turns, and moves over the values between two turns."""
    columns = following(seed, 8.0)
    rate = smooth(len(columns["gap"]), 1.5, np.random.default_rng([seed, 1]))
    columns["gap"] = 40.0 + np.cumsum(0.1 * (rate - rate.mean()))
    columns["range_rate"] = np.rint((rate - rate.mean()) / step) * step
    assert "range_rate_repeated" not in {one.name for one in findings(columns)}


@mostly(0.95)
def test_a_brief_fault_ends(seed: int) -> None:
    """A range rate that stands still for 20 s is found, and the finding ends."""
    columns = following(seed, 6.0)
    columns["range_rate"][600:800] = columns["range_rate"][600]
    found = [one for one in findings(columns) if one.name == "range_rate_frozen"]
    assert len(found) == 1
    assert 59.0 <= found[0].since <= 61.0
    assert found[0].until - 80.0 >= signal_checks.HOLD_S - 2.0


@pytest.mark.slow("checks whole drives")
@mostly(0.95)
def test_the_interval_of_the_reports_age_holds(seed: int) -> None:
    """Reports that are 0.5 s old: the interval holds that on most drives where it is stated, and 0 s is no finding."""
    held = []
    for k in range(8):
        columns = following(seed + k, 5.0)
        for name in ("gap", "range_rate"):
            columns[name] = np.concatenate([np.full(5, columns[name][0]), columns[name][:-5]])
        age, half = own_motion.interval(final_own_motion(columns))
        held += [abs(age - 0.5) < half] if half == half else []
        assert all("-" not in one.says for one in findings(columns) if one.name == "radar_latency")
    # 95 % each; where the lead hides the own motion nothing is stated
    assert held.count(False) <= 3


@pytest.mark.parametrize("seed", [1470058, 1470275])
def test_a_driver_who_answers_at_once_is_no_latency(seed: int) -> None:
    """The own motion answers the lead's, which looks like a delay of the radar: on these drives it was called 0.25 s."""
    columns = following(seed, 8.0)
    assert not [each.says for each in findings(columns) if each.name == "radar_latency"]


def final_own_motion(columns: Columns) -> own_motion.State:
    """Run the checks, and return what the one of the own motion knows."""
    state = signal_checks.init()
    for sample in samples(columns):
        state, _ = signal_checks.step(state, sample, Driver(), 0.1)
    return next(
        of for of, check in zip(state.checks, signal_checks.CHECKS, strict=True) if check is own_motion.CHECK
    )


@mostly(0.95)
def test_a_minute_of_short_headways_is_no_unit(seed: int) -> None:
    """Five minutes at two seconds, then two behind a lead that is nearer than a third of a second: no car's unit changes."""
    before, after = following(seed, 5.0), following(seed + 1, 2.0)
    after["gap"] = after["gap"] / 7.0
    after["range_rate"] = after["range_rate"] / 7.0
    joined = {name: np.concatenate([x, after[name]]) for name, x in before.items()}
    state = final_own_motion(joined | {"gap": joined["gap"]})
    assert sorted(state.headways)[len(state.headways) // 2] < own_motion.SHORTEST_HEADWAY_S
    assert state.found is None or state.found.name != "speed_unit"
    # from the beginning on it is one
    alone = final_own_motion(after).found
    assert alone is not None
    assert alone.name == "speed_unit"


def test_units_are_named() -> None:
    """Every factor of a confusion of units has its name, and a tyre's radius has none."""
    assert all(unit_of(1.02 * factor) == says for factor, says in UNIT_FACTORS.items())
    assert unit_of(1.04) == ""


def test_what_the_model_does_not_need_withholds_nothing(seed: int) -> None:
    """A finding on the acceleration is reported, and estimates of a pedal go on."""
    columns = changed("accel", lambda x: -x)(following(seed))
    found = findings(columns)
    assert {one.name for one in found} == {"accel_sign"}
    assert not found[0].withholds
    assert findings(columns, Driver(output="accel"))[0].withholds


def test_a_drive_without_signals_raises_nothing() -> None:
    """Columns that are missing, or NaN throughout, are no fault and no exception."""
    columns = following(1, 1.0)
    empty = {name: np.full_like(x, np.nan) for name, x in columns.items()}
    assert findings(empty) == ()
    assert findings(columns, without=("speed", "lead_valid", "brake", "accel")) == ()
