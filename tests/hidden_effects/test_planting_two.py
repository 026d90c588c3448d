"""Planting simulator two does what it says: the planted driver drives, each effect means its parameter, truth is true."""

from __future__ import annotations

import ast
import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import tests.plants.plant_two as folder
from tests.plants.plant_two import plant
from tests.plants.plant_two.car import Car, accelerate
from tests.plants.plant_two.plan import IN_CAR, IN_DRIVER
from tests.plants.plant_two.remnant import unit_remnant
from tests.plants.plant_two.strengths import USUAL
from tests.plants.planted_drive import EFFECTS, NOISES, OUTSIDE, PROFILES, Array, Planted

HERE = Path(folder.__file__).parent
CATALOGUE = [effect for effects in EFFECTS.values() for effect in effects]


@cache
def drive(effect: str = "", profile: str = "mixed", minutes: float = 4.0, **values: float) -> Planted:
    """Plant one effect, or none, with seed 5."""
    effects = {effect: values} if effect else {}
    return plant(effects, seed=5, minutes=minutes, noise="ar1", profile=profile)


# --- the textbook's driver, on whole columns -----------------------------------------------------------


def later(x: Array, seconds: Array | float, dt: float) -> Array:
    """What x was some time ago."""
    k = np.arange(len(x))
    return np.interp(k - np.asarray(seconds) / dt, k, x)


def lagged(x: Array, tau: float, dt: float) -> Array:
    """1 / (1 + tau s) by the exact solution for an input that is straight between samples."""
    decay = math.exp(-dt / tau)
    ramp = tau / dt * (1.0 - decay)
    out = np.empty(len(x))
    y = before = float(x[0])
    for k, now in enumerate(x.tolist()):
        y = decay * y + (ramp - decay) * before + (1.0 - ramp) * now
        before = now
        out[k] = y
    return out


def dead(x: Array, width: Array | float) -> Array:
    """A dead zone with corners."""
    return x - np.clip(x, -width, width)


# effect -> what it changes, with corners: (error, rate, gain1, gain2, beside1, beside2, delay) of (columns, value)
Hard = Callable[[dict[str, Array], float], dict[str, Array | float]]
HARD: dict[str, tuple[str, float, Hard]] = {
    "headway_dead_zone": ("width", 0.4, lambda c, x: {"error": dead(c["error"], x)}),
    "relative_speed_dead_zone": ("width", 0.8, lambda c, x: {"rate": dead(c["rate"], x)}),
    "looming_threshold": (
        "threshold",
        0.003,
        lambda c, x: {"rate": dead(c["rate"], x * c["gap"] ** 2 / 1.8)},
    ),
    "looming_gain": ("exponent", 0.5, lambda c, x: {"gain2": (30.0 / c["gap"]) ** x}),
    "asymmetric_gain": ("share", 0.3, lambda c, x: {"gain2": 1.0 - x * np.sign(c["rate"])}),
    "gain_drift": (
        "rate",
        0.8,
        lambda c, x: {"gain1": 1.0 + x * (c["done"] - 0.5), "gain2": 1.0 + x * (c["done"] - 0.5)},
    ),
    "delay_drift": ("rate", 0.3, lambda c, x: {"delay": x * (c["done"] - 0.5)}),
    "standstill_gap": ("distance", 5.0, lambda c, x: {"error": c["error"] - x / c["speed"]}),
    "speed_gain": ("exponent", 0.9, lambda c, x: {"gain1": (c["speed"] / 20.0) ** x}),
    "lead_acceleration": ("gain", 4.0, lambda c, x: {"beside2": x * c["lead_accel"]}),
}


def textbook(planted: Planted, change: dict[str, Array | float]) -> Array:
    """The driver's pedal along the columns."""
    c, d, dt = planted.columns, planted.truth["driver"], planted.dt
    known = seen(planted) | change
    one = d["K1"] * known.get("gain1", 1.0) * known["error"]
    two = d["K2"] * known.get("gain2", 1.0) * known["rate"] + known.get("beside2", 0.0)
    wait = known.get("delay", 0.0)
    both = later(one, d["dead_time1"] + wait, dt) + later(two, d["dead_time2"] + wait, dt)
    assert len(both) == len(c["t"])
    return d["offset"] + lagged(both, d["tau1"], dt)


def seen(planted: Planted) -> dict[str, Array | float]:
    c = planted.columns
    lead_speed = c["speed"] + c["range_rate"]
    return {
        "error": c["gap"] / c["speed"] - planted.truth["driver"]["headway_desired"],
        "rate": c["range_rate"],
        "gap": c["gap"],
        "speed": c["speed"],
        "done": c["t"] / (len(c["t"]) * planted.dt),
        "lead_accel": np.gradient(lead_speed, planted.dt),
    }


# --- the driver -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", PROFILES)
def test_a_clean_drive_is_the_textbook_driver_and_his_noise(profile: str) -> None:
    p = drive(profile=profile)
    free = (p.columns["pedal"] > 0.0) & (p.columns["pedal"] < 100.0)
    np.testing.assert_allclose(p.demand, textbook(p, {}), atol=0.02)
    np.testing.assert_allclose(p.columns["pedal"], np.clip(p.demand + p.remnant, 0.0, 100.0), atol=1e-9)
    assert 0.5 < free.mean() < 1.0 or profile == "motorway"
    assert p.truth["driver"]["tau1"] == p.truth["driver"]["tau2"]


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("effect", HARD)
def test_a_smooth_effect_means_what_its_hard_form_means(effect: str) -> None:
    """Of all strengths, the hard form with about the planted one is nearest to what the smooth one does."""
    name, value, hard = HARD[effect]
    p = drive(effect, **{name: value})
    away = p.demand - p.without[effect]
    found = minimize_scalar(
        lambda x: float(np.var(p.demand - textbook(p, hard(seen(p), x)))),
        bounds=(0.4 * value, 1.8 * value),
        method="bounded",
    )
    assert found.x == pytest.approx(value, rel=0.1)
    assert found.fun < 0.06 * np.var(away), "what the corners' roundness leaves over"
    np.testing.assert_allclose(p.without[effect], textbook(p, {}), atol=0.02)


def test_comfort_speed_takes_gas_away_above_it() -> None:
    p = drive("comfort_speed", gain=1.5, speed=20.0)
    d = p.truth["driver"]
    hard = -1.5 * np.maximum(p.columns["speed"] - 20.0, 0.0)
    away = p.demand - p.without["comfort_speed"]
    expected = lagged(later(hard, d["dead_time1"], p.dt), d["tau1"], p.dt)
    assert np.var(away - expected) < 0.02 * np.var(away)


def test_a_gain_change_takes_its_share_within_twenty_seconds() -> None:
    p = drive("gain_change", share=0.4, time=120.0)
    answer, plain = (
        p.demand - p.truth["driver"]["offset"],
        p.without["gain_change"] - p.truth["driver"]["offset"],
    )
    t = p.columns["t"]
    early, late = t < 100.0, t > 140.0
    assert (answer[early] @ plain[early]) / (plain[early] @ plain[early]) == pytest.approx(1.0, abs=0.02)
    assert (answer[late] @ plain[late]) / (plain[late] @ plain[late]) == pytest.approx(0.6, abs=0.02)


@pytest.mark.slow("whole drives through the pipeline")
def test_the_wanted_headway_wanders_by_its_sd() -> None:
    p = drive("headway_drift", minutes=10.0, sd=0.4)
    walk = (p.demand - p.without["headway_drift"]) / p.truth["driver"]["K1"]
    assert walk.std() == pytest.approx(0.4, rel=0.03)
    # slow: within two seconds it moves by a small part of what it moves at all
    assert np.std(walk[200:] - walk[:-200]) < 0.15


def test_a_second_lag_lags() -> None:
    p = drive("second_lag", tau=0.5)
    offset = p.truth["driver"]["offset"]
    expected = offset + lagged(p.without["second_lag"] - offset, 0.5, p.dt)
    np.testing.assert_allclose(p.demand, expected, atol=0.02)


def test_act_and_wait_stands_still_most_of_the_time_and_changes_at_its_interval() -> None:
    p = drive("act_and_wait", interval=1.5)
    moving = np.abs(np.diff(p.demand)) > 1e-9
    assert moving.mean() == pytest.approx(0.3 / 1.5, abs=0.05)
    starts = np.flatnonzero(moving[1:] & ~moving[:-1]) * p.dt
    gaps = np.diff(starts)
    np.testing.assert_allclose(gaps / 1.5, np.round(gaps / 1.5), atol=0.02)


def test_a_periodic_task_is_a_line_in_the_spectrum() -> None:
    p = drive("periodic_task", amplitude=2.0, frequency=0.15)
    added = p.demand - p.without["periodic_task"]
    spectrum = np.abs(np.fft.rfft(added)) ** 2
    frequency = np.fft.rfftfreq(len(added), p.dt)
    assert added.std() == pytest.approx(2.0 / math.sqrt(2.0), rel=0.05)
    assert frequency[np.argmax(spectrum)] == pytest.approx(0.15, abs=0.01)


def test_the_pedal_stays_below_its_ceiling_and_reaches_it() -> None:
    p = drive("pedal_ceiling", level=16.0)
    assert p.columns["pedal"].max() <= 16.0
    assert np.mean(p.columns["pedal"] > 15.5) > 0.02
    assert p.without["pedal_ceiling"].max() > 18.0


def test_backlash_holds_the_pedal_at_reversals_and_never_lets_go_by_more_than_half_its_width() -> None:
    p = drive("backlash", width=5.0)
    pressed = p.without["backlash"] + p.remnant
    free = p.columns["pedal"] > 0.0
    play = (p.columns["pedal"] - pressed)[free]
    assert 2.3 < np.abs(play).max() < 2.8
    assert np.mean(np.diff(p.columns["pedal"])[free[1:]] == 0.0) > 0.2


def test_an_attention_gap_holds_the_pedal_and_comes_back_within_its_release() -> None:
    p = drive("attention_gap", per_minute=1.5, duration=3.0)
    t, pedal = p.columns["t"], p.columns["pedal"]
    gaps = p.truth["episodes"]["attention_gap"]
    assert len(gaps) >= 3
    for start, stop in gaps:
        assert 1.5 <= stop - start <= 6.0
        assert np.ptp(pedal[(t >= start) & (t < stop)]) == pytest.approx(0.0, abs=1e-9)
    outside = np.ones(len(t), bool)
    for start, stop in gaps:
        outside &= (t < start) | (t > stop + 0.31)
    free = outside & (pedal > 0.0)
    np.testing.assert_allclose((p.demand + p.remnant)[free], pedal[free], atol=1e-6)


@pytest.mark.parametrize("effect", ["pulse_and_glide", "pedal_steps", "uneven_lag", "speed_keeping"])
def test_what_is_in_no_catalogue_changes_the_driver(effect: str) -> None:
    p = drive(effect, minutes=2.0)
    assert effect in OUTSIDE
    assert effect not in CATALOGUE
    assert np.std(p.demand - p.without[effect]) > 0.3


def test_pulse_and_glide_has_two_levels_that_change_beyond_the_band() -> None:
    p = drive("pulse_and_glide", swing=3.0, band=0.5)
    added = p.demand - p.without["pulse_and_glide"]
    assert np.mean(np.abs(np.abs(added) - 3.0) < 0.3) > 0.6
    turns = np.flatnonzero(np.diff(np.sign(added)))
    # 0.4 s after the threshold the sign turns
    before = p.columns["range_rate"][np.maximum(turns - 30, 0)]
    assert np.all(np.abs(before[1:]) > 0.2)


def test_a_driver_who_feels_acceleration_presses_less_while_he_accelerates() -> None:
    p = drive("felt_acceleration", gain=5.0)
    added = p.demand - p.without["felt_acceleration"]
    d = p.truth["driver"]
    felt = -5.0 * lagged(later(p.columns["accel"], d["dead_time2"], p.dt), d["tau1"], p.dt)
    assert np.corrcoef(added, felt)[0, 1] > 0.99


def test_a_startled_driver_lifts_after_hard_braking_only() -> None:
    p = drive("brake_light_startle", minutes=8.0, drop=10.0, threshold=1.0)
    added = p.demand - p.without["brake_light_startle"]
    lead_accel = np.gradient(p.columns["speed"] + p.columns["range_rate"], p.dt)
    recent = np.array([lead_accel[max(k - 600, 0) : k + 1].min() for k in range(0, len(added), 50)])
    assert added.min() < -4.0
    assert added[::50][recent > -0.4].min() > -0.5


# --- noise, car, masks -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "memory"), [("white", 0.03), ("ar1", 1.0), ("ar4", 4.0), ("state", 1.0)])
def test_the_noise_has_its_colour(kind: str, memory: float) -> None:
    x = unit_remnant(kind, 300_000, 0.01, 0.4, np.random.default_rng(11))
    lag = max(round(memory / 0.01), 1)
    assert x.std() == pytest.approx(1.0, abs=0.1)
    assert x[:-lag] @ x[lag:] / (x @ x) == pytest.approx(math.exp(-1.0), abs=0.08)


def test_resonant_noise_peaks_at_a_quarter_hertz_and_mixed_noise_is_thirty_per_cent_white() -> None:
    x = unit_remnant("resonant", 400_000, 0.01, 0.3, np.random.default_rng(12))
    power = np.abs(np.fft.rfft(x.reshape(20, -1))) ** 2
    frequency = np.fft.rfftfreq(20_000, 0.01)
    smooth = np.convolve(power.mean(axis=0), np.ones(5), "same")
    # the peak lies at sqrt(1 - 2 damping²) of the natural frequency
    assert frequency[np.argmax(smooth)] == pytest.approx(0.25 * math.sqrt(1 - 2 * 0.3**2), abs=0.03)
    assert x.std() == pytest.approx(1.0, abs=0.1)
    y = unit_remnant("mix", 400_000, 0.01, 0.4, np.random.default_rng(13))
    assert y[:-20] @ y[20:] / (y @ y) == pytest.approx(0.7 * math.exp(-0.2), abs=0.05)


def test_state_dependent_noise_grows_with_the_answer() -> None:
    p = plant({}, seed=8, minutes=10, noise="state", profile="mixed")
    answer = np.abs(p.demand - p.truth["driver"]["offset"])
    low, high = np.quantile(answer, [0.3, 0.8])
    assert p.remnant[answer > high].std() > 2.0 * p.remnant[answer < low].std()


def test_the_noise_moves_the_car() -> None:
    """Another remnant, another trajectory behind the same lead."""
    a = plant({}, seed=6, minutes=1, noise="ar1", profile="mixed")
    b = plant({}, seed=6, minutes=1, noise="ar4", profile="mixed")
    lead = [p.columns["speed"] + p.columns["range_rate"] for p in (a, b)]
    np.testing.assert_allclose(lead[0], lead[1], atol=1e-9)
    assert np.abs(a.columns["speed"] - b.columns["speed"]).max() > 0.1


@pytest.mark.parametrize(
    ("effect", "value", "why"),
    [
        ("headwind", 10.0, "slower"),
        ("engine_braking", 0.8, "slower without gas"),
        ("power_limit", 6.0, "slower at speed"),
        ("turbo_lag", 1.0, "later"),
        ("actuator_lag", 0.5, "later"),
        ("pedal_map", 0.5, "less at little gas"),
        ("gear_ratio", 0.2, "less in high gears"),
    ],
)
def test_a_car_with_an_effect_pulls_less(effect: str, value: float, why: str) -> None:
    """After a tip-in from no gas at 30 m/s, the effect's car has gained less speed."""
    field, _, adds = IN_CAR[effect]
    plain = Car()
    changed = plain._replace(**{field: value + (getattr(plain, field) if adds else 0.0)})

    def gained(car: Car, throttle: float) -> float:
        # both cars come from the same engine state
        step = accelerate(plain._replace(**{field: getattr(car, field)}), 30.0, 0.01)
        for _ in range(500):
            step(0.0, 0.0, 0.0, car.headwind, 30.0, True)
        return sum(0.01 * step(throttle, 0.0, 0.0, car.headwind, 30.0, True) for _ in range(200))

    throttle = 0.0 if effect == "engine_braking" else 8.0
    assert gained(changed, throttle) < gained(plain, throttle) - 0.02, why


@pytest.mark.slow("whole drives through the pipeline")
def test_the_road_has_the_planted_slope_and_altitude_is_its_integral() -> None:
    p = drive("road_grade", minutes=10.0, sd=2.0)
    c = p.columns
    assert 1.0 < c["grade"].std() < 3.0
    way = np.concatenate([[0.0], np.cumsum(c["speed"][:-1] * p.dt)])
    climbed = np.concatenate([[0.0], np.cumsum(np.diff(way) * c["grade"][:-1] / 100.0)])
    np.testing.assert_allclose(c["altitude"] - c["altitude"][0], climbed, atol=0.2)
    assert drive().columns["grade"].std() == 0.0


def test_the_columns_obey_kinematics() -> None:
    p = drive("cut_in", time=60.0)
    c, dt = p.columns, p.dt
    np.testing.assert_allclose(np.diff(c["speed"]), c["accel"][:-1] * dt, atol=1e-9)
    closed = np.diff(c["gap"]) - 0.5 * dt * (c["range_rate"][1:] + c["range_rate"][:-1])
    jump = np.flatnonzero(np.abs(closed) > 0.05)
    assert jump.tolist() == [5999]
    assert 0.45 < c["gap"][6000] / c["gap"][5999] < 0.7


def test_in_cruise_control_no_foot_is_on_the_pedal_and_the_car_still_follows() -> None:
    p = drive("cruise_control", minutes=8.0)
    c = p.columns
    [[start, stop]] = p.truth["episodes"]["cruise_control"]
    on = (c["t"] >= start) & (c["t"] < stop)
    assert on.sum() * p.dt > 30.0
    np.testing.assert_array_equal(c["cruise_active"], on.astype(float))
    assert np.all(c["pedal"][on] == 0.0)
    assert np.std(c["range_rate"][on]) < 3.0
    assert c["gap"][on].min() > 3.0


def test_gear_shifts_lift_the_foot_and_open_the_clutch() -> None:
    p = drive("gear_shift", per_minute=3.0, duration=0.7)
    c = p.columns
    shifts = p.truth["episodes"]["gear_shift"]
    assert len(shifts) > 5
    for start, stop in shifts:
        middle = (c["t"] > start + 0.13) & (c["t"] < stop)
        assert np.all(c["pedal"][middle] == 0.0)
        assert np.all(c["clutch"][middle] == 1.0)
    assert c["clutch"].mean() < 0.1


def test_a_resting_foot_brakes_while_gas_is_given() -> None:
    p = drive("brake_overlap", per_minute=3.0, duration=2.0)
    c = p.columns
    inside = np.zeros(len(c["t"]), bool)
    for start, stop in p.truth["episodes"]["brake_overlap"]:
        inside |= (c["t"] >= start) & (c["t"] < stop)
    assert np.all(c["brake"][inside] == 1.0)
    assert np.mean(c["pedal"][inside] > 0.0) > 0.5
    clean = drive().columns
    assert np.mean((clean["brake"] == 1.0) & (clean["pedal"] > 0.0)) < 0.01


@pytest.mark.parametrize("effect", [*EFFECTS["sensing"], "stale_signal"])
def test_what_is_wrong_in_the_sensing_changes_nothing_but_the_truth(effect: str) -> None:
    p, clean = drive(effect, minutes=1.0), drive(minutes=1.0)
    for role, column in clean.columns.items():
        np.testing.assert_array_equal(p.columns[role], column)
    assert effect in p.truth["effects"]


# --- the whole ----------------------------------------------------------------------------------------------


def test_every_effect_of_the_catalogue_is_known_and_some_that_are_outside() -> None:
    assert set(CATALOGUE) <= set(USUAL)
    assert len(set(USUAL) - set(CATALOGUE)) >= 4
    assert set(USUAL) - set(CATALOGUE) <= set(OUTSIDE)
    assert set(USUAL) & (set(EFFECTS["driver"]) | set(OUTSIDE)) == set(IN_DRIVER)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("effect", USUAL)
def test_a_strength_that_nobody_gave_is_drawn_and_told(effect: str) -> None:
    p = plant({effect: {}}, seed=9, minutes=0.4, noise="mix", profile="mixed")
    stored = json.loads(json.dumps(p.truth))
    assert stored == p.truth
    values = stored["effects"][effect]
    assert all(math.isfinite(x) for x in values.values())
    assert values or effect == "range_rate_sign"
    assert sorted(p.without) == ([effect] if effect in IN_DRIVER else [])
    again = plant({effect: values}, seed=9, minutes=0.4, noise="mix", profile="mixed")
    np.testing.assert_array_equal(again.columns["pedal"], p.columns["pedal"])


def test_two_effects_at_once_leave_the_lead_as_it_was() -> None:
    both = plant(
        {"asymmetric_gain": {}, "attention_gap": {}}, seed=4, minutes=2, noise="ar1", profile="urban"
    )
    alone = plant({"attention_gap": {}}, seed=4, minutes=2, noise="ar1", profile="urban")
    assert both.truth["episodes"] == alone.truth["episodes"]
    assert both.truth["effects"]["attention_gap"] == alone.truth["effects"]["attention_gap"]
    leads = [p.columns["speed"] + p.columns["range_rate"] for p in (both, alone)]
    np.testing.assert_allclose(leads[0], leads[1], atol=1e-9)
    # each switched off is another driver than both
    assert set(both.without) == {"asymmetric_gain", "attention_gap"}
    assert np.std(both.without["asymmetric_gain"] - both.without["attention_gap"]) > 0.1


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("noise", NOISES)
def test_every_drive_stays_on_the_road(profile: str, noise: str) -> None:
    """Nothing runs away and nobody touches, whatever the noise; the speeds are the profile's."""
    slowest, fastest = {"mixed": (9.0, 34.5), "urban": (1.5, 15.0), "motorway": (23.0, 34.5)}[profile]
    for seed in (31, 32):
        p = plant({}, seed=seed, minutes=1, noise=noise, profile=profile)
        c = p.columns
        assert set(c) >= {"t", "pedal", "gnss_speed", "gear", "engine_speed", "altitude", "lead_valid"}
        assert all(len(x) == 6_000 and np.isfinite(x).all() for x in [*c.values(), p.demand, p.remnant])
        assert c["gap"].min() > 2.0
        assert c["gap"].max() < 150.0
        lead = c["speed"] + c["range_rate"]
        assert slowest < lead.min() < lead.max() < fastest
        assert c["pedal"].min() >= 0.0
        assert c["pedal"].max() <= 100.0
        assert 1.5 <= p.truth["driver"]["noise_sd"] <= 3.0


def test_in_town_the_foot_leaves_the_pedal_part_of_the_time() -> None:
    assert 0.05 < np.mean(drive(profile="urban", minutes=10.0).columns["pedal"] == 0.0) < 0.4


def test_changes_reach_the_driver_and_the_car() -> None:
    p = plant({}, seed=1, minutes=0.5, noise="ar1", profile="mixed", K2=7.0, tau2=0.4, gain=0.03)
    assert p.truth["driver"]["K2"] == 7.0
    assert p.truth["driver"]["tau1"] == p.truth["driver"]["tau2"] == 0.4
    assert p.truth["car"]["gain"] == 0.03


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"effects": {"telepathy": {}}}, "telepathy"),
        ({"effects": {"backlash": {"depth": 3.0}}}, "depth"),
        ({"noise": "pink"}, "pink"),
        ({"profile": "desert"}, "desert"),
        ({"horn": 1.0}, "horn"),
        ({"tau1": 0.3, "tau2": 0.4}, "common lag"),
    ],
)
def test_what_it_does_not_know_it_refuses(wrong: dict[str, object], says: str) -> None:
    call = {"effects": {}, "seed": 1, "minutes": 0.2, "noise": "ar1", "profile": "mixed"} | wrong
    effects = call.pop("effects")
    with pytest.raises(ValueError, match=says):
        plant(effects, **call)  # type: ignore[arg-type]


def test_it_owes_nothing_to_canid_nor_to_the_other_simulator() -> None:
    names: set[str] = set()
    for path in HERE.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names |= {node.module or "."}
    assert not {name for name in names if name.split(".")[0] == "canid" or "plant_one" in name}
