"""Planting simulator one does what it says: each effect by a second route, in whole columns, along the drive that was."""

from __future__ import annotations

import ast
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.plants import plant_one
from tests.plants.first_order_lag import answer
from tests.plants.plant_one import plant
from tests.plants.plant_one.strengths import STRENGTHS
from tests.plants.planted_drive import EFFECTS, NOISES, OUTSIDE, PROFILES, Array, Planted
from tests.seeds import mostly

# s at the begin that comparisons leave out: ten of the longest lags
SETTLED = 8.0
HANDED = {"range_rate_sign"}  # have no strength


def drive(
    *ids: str, seed: int = 11, minutes: float = 2.0, noise: str = "ar1", profile: str = "mixed", **how
) -> Planted:  # type: ignore[no-untyped-def]
    return plant(
        {name: how.pop(name, {}) for name in ids},
        seed=seed,
        minutes=minutes,
        noise=noise,
        profile=profile,
        **how,
    )


def late(planted: Planted) -> slice:
    return slice(round(SETTLED / planted.dt), None)


# --- the loop --------------------------------------------------------------------------------------


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("profile", PROFILES)
def test_the_loop_is_stable(profile: str) -> None:
    """Whoever drives, however his noise sounds: the gap stays open, and full braking stays rare."""
    for seed in range(8):
        p = drive(seed=seed, minutes=3.0, noise=NOISES[seed % len(NOISES)], profile=profile)
        c = p.columns
        assert all(np.isfinite(x).all() and len(x) == len(p.demand) for x in c.values())
        assert c["gap"].min() > 1.0
        assert c["speed"].min() > 1.0
        assert (c["gap"] / c["speed"]).max() < 8.0
        assert p.truth["emergency"] < 0.02 * 180.0
        assert c["pedal"].min() >= 0.0
        assert c["pedal"].max() <= 100.0


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("name", sorted(STRENGTHS))
def test_no_effect_wrecks_the_car(name: str) -> None:
    """At the strength that the seed draws, every effect leaves a drive that can be driven."""
    p = drive(name, seed=3, minutes=1.5, profile="urban")
    assert p.columns["gap"].min() > 0.5
    assert p.truth["emergency"] < 5.0
    assert set(p.truth["effects"]) == {name}
    assert p.truth["effects"][name] or name in HANDED


def test_profiles_are_the_roads_that_they_name() -> None:
    """Town is slow with the pedal at its floor now and then; motorways are fast."""
    urban, motorway = (drive(profile=profile, minutes=4.0).columns for profile in ("urban", "motorway"))
    assert urban["speed"].max() < 16.0
    assert 0.03 < (urban["pedal"] == 0.0).mean() < 0.4
    assert motorway["speed"].min() > 20.0


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("noise", NOISES)
def test_the_noise_has_its_size_and_moves_the_car(noise: str) -> None:
    """Its sd is the driver's, whatever its spectrum, and another noise is another drive."""
    p, calm = drive(noise=noise, minutes=10.0, seed=4), drive(noise=noise, minutes=10.0, seed=4, noise_sd=0.0)
    # AR 4 s has 75 independent samples in 10 min: 3 sd of its sd are a quarter; "state" depends on the traffic
    assert p.remnant.std() == pytest.approx(
        p.truth["driver"]["noise_sd"], rel=0.6 if noise == "state" else 0.25
    )
    assert np.abs(p.columns["gap"] - calm.columns["gap"]).max() > 0.5


def test_noise_that_grows_with_the_answer() -> None:
    """Where the answer is large, so is the noise."""
    p = drive(noise="state", minutes=10.0)
    size = np.abs(p.demand - p.truth["driver"]["offset"])
    large, small = size > np.quantile(size, 0.7), size < np.quantile(size, 0.3)
    assert p.remnant[large].std() > 1.8 * p.remnant[small].std()


def test_names_that_nobody_knows_are_refused() -> None:
    for wrong in ({"headway_deadzone": {}}, {"headway_dead_zone": {"widht": 0.3}}):
        with pytest.raises(ValueError, match="headway_dead"):
            plant(wrong, seed=1, minutes=1.0, noise="ar1", profile="mixed")
    for key, value in (("noise", "pink"), ("profile", "alps"), ("minutes", 0.2), ("k1", 3.0)):
        with pytest.raises(ValueError, match=key):
            plant({}, **{"seed": 1, "minutes": 1.0, "noise": "ar1", "profile": "mixed", key: value})  # type: ignore[arg-type]


def test_what_is_given_is_planted_and_the_rest_drawn() -> None:
    p = drive("gain_change", gain_change={"share": 0.31}, K2=5.5, grade_sd=0.0)
    assert p.truth["effects"]["gain_change"]["share"] == 0.31
    assert 0.0 < p.truth["effects"]["gain_change"]["time"] < 120.0
    assert p.truth["driver"]["K2"] == 5.5
    assert not p.columns["grade"].any()


def test_effects_change_neither_driver_nor_road() -> None:
    """A pair of drives with and without an effect shares everything else."""
    one, two = drive(), drive("backlash", "looming_gain")
    assert one.truth["driver"] == two.truth["driver"]
    assert one.truth["car"] == two.truth["car"]
    np.testing.assert_array_equal(one.remnant, two.remnant)
    lead = [p.columns["speed"] + p.columns["range_rate"] for p in (one, two)]
    np.testing.assert_allclose(*lead, atol=1e-9)


def test_every_name_of_the_catalogue_can_be_planted() -> None:
    assert {name for names in EFFECTS.values() for name in names} <= set(STRENGTHS)
    assert len(set(STRENGTHS) & set(OUTSIDE)) >= 4


def test_nothing_comes_from_what_is_judged() -> None:
    """The simulator shares no line with canid's own."""
    folder = Path(plant_one.__file__).parent
    for file in folder.glob("*.py"):
        names = {
            module
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
            for module in (
                [a.name for a in node.names] if isinstance(node, ast.Import)
                else [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            )
        }  # fmt: skip
        assert not [name for name in names if name.startswith(("canid", "tests.plants.plant_two"))], file


def inside(planted: Planted, name: str) -> Array:
    t, out = planted.columns["t"], np.zeros(len(planted.columns["t"]))
    for start, stop in planted.truth["episodes"][name]:
        out[(t > start - 0.011) & (t < stop - 0.011)] = 1.0
    return out


# --- the driver, by a second route -----------------------------------------------------------------


class Seen:
    """What the driver of a drive saw, as columns without his dead time."""

    def __init__(self, planted: Planted) -> None:
        c, d = planted.columns, planted.truth["driver"]
        self.t, self.v, self.g, self.w = c["t"], np.maximum(c["speed"], 2.0), c["gap"], c["range_rate"]
        self.e = self.g / self.v - d["headway_desired"]
        self.a = np.gradient(c["speed"] + c["range_rate"], planted.dt)
        self.K1, self.K2 = d["K1"], d["K2"]
        self.T = 60.0 * planted.truth["minutes"]


def dz(x: Array, width: float | Array) -> Array:
    return np.sign(x) * np.maximum(np.abs(x) - width, 0.0)


Both = tuple[Array, Array]
FORMS: dict[str, Callable[..., Both]] = {
    "headway_dead_zone": lambda s, width: (s.K1 * dz(s.e, width), s.K2 * s.w),
    "relative_speed_dead_zone": lambda s, width: (s.K1 * s.e, s.K2 * dz(s.w, width)),
    "looming_threshold": lambda s, threshold: (s.K1 * s.e, s.K2 * dz(s.w, threshold * s.g**2 / 1.8)),
    "looming_gain": lambda s, exponent: (s.K1 * s.e, s.K2 * s.w * (30.0 / s.g) ** exponent),
    "asymmetric_gain": lambda s, share: (s.K1 * s.e, s.K2 * (s.w - share * np.abs(s.w))),
    "standstill_gap": lambda s, distance: (s.K1 * (s.e - distance / s.v), s.K2 * s.w),
    "speed_gain": lambda s, exponent: (s.K1 * s.e * (s.v / 20.0) ** exponent, s.K2 * s.w),
    "comfort_speed": lambda s, gain, speed: (s.K1 * s.e - gain * np.clip(s.v - speed, 0.0, None), s.K2 * s.w),
    "lead_acceleration": lambda s, gain: (s.K1 * s.e, s.K2 * s.w + gain * s.a),
    "saturating_speed": lambda s, limit: (s.K1 * s.e, s.K2 * limit * np.tanh(s.w / limit)),
    "quadratic_headway": lambda s, curvature: (s.K1 * (s.e + curvature * s.e * np.abs(s.e)), s.K2 * s.w),
    "preview_gap_rate": lambda s, preview: (s.K1 * (s.e + preview * s.w / s.v), s.K2 * s.w),
}


def answered(planted: Planted, x1: Array, x2: Array) -> Array:
    """Demand (n,) % by the textbook's lag (written for another benchmark), exact for inputs joined by lines."""
    d = planted.truth["driver"]
    return (
        d["offset"]
        + answer(x1, planted.dt, d["tau1"], d["dead_time1"])
        + answer(x2, planted.dt, d["tau2"], d["dead_time2"])
    )


def baseline(planted: Planted) -> Array:
    s = Seen(planted)
    return answered(planted, s.K1 * s.e, s.K2 * s.w)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("seed", [1, 2, 3])
@mostly(0.95)
def test_a_clean_drive_is_the_baseline(profile: str, seed: int) -> None:
    """Demand is Grover's two answers and nothing else; the pedal is demand and noise within its limits."""
    p = drive(seed=seed, profile=profile)
    np.testing.assert_allclose(p.demand, baseline(p), atol=0.02)
    free = p.columns["brake"] == 0.0
    np.testing.assert_array_equal(p.columns["pedal"][free], np.clip(p.demand + p.remnant, 0.0, 100.0)[free])
    assert p.truth["effects"] == {}
    assert p.truth["episodes"] == {}


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("name", sorted(FORMS))
@pytest.mark.parametrize("profile", ["mixed", "urban"])
def test_a_changed_answer_has_the_form_that_it_names(name: str, profile: str) -> None:
    """Along the drive, demand is that of the catalogue's formula, and far from that of the baseline."""
    p = drive(name, profile=profile, seed=21)
    expected = answered(p, *FORMS[name](Seen(p), **p.truth["effects"][name]))
    wrong = (p.demand - expected)[late(p)].std()
    hidden = (p.demand - baseline(p))[late(p)].std()
    assert hidden > 0.1
    # speed and gap are taken at the nearest step, not between two: some hundredths of a per cent
    assert wrong < max(0.02 * hidden, 0.02)
    np.testing.assert_allclose(p.without[name], baseline(p), atol=0.02)


def test_gains_change_along_the_drive() -> None:
    """gain_drift is linear about the middle, gain_change a step: the factor is that of the instant of answering."""
    for name in ("gain_drift", "gain_change"):
        p = drive(name)
        s, how, d = Seen(p), p.truth["effects"][name], p.truth["driver"]

        def factor(t: Array, how: dict[str, float] = how, s: Seen = s) -> Array:
            return (
                1.0 + how["rate"] * (t / s.T - 0.5)
                if "rate" in how
                else np.where(t > how["time"], 1.0 - how["share"], 1.0)
            )

        x1, x2 = s.K1 * s.e * factor(s.t + d["dead_time1"]), s.K2 * s.w * factor(s.t + d["dead_time2"])
        assert (p.demand - baseline(p)).std() > 0.3
        assert (p.demand - answered(p, x1, x2))[late(p)].std() < 0.05


def test_the_wanted_headway_wanders() -> None:
    """What is missing in the baseline is K1 times a slow signal of the stated sd."""
    p = drive("headway_drift", minutes=10.0)
    hidden = (p.without["headway_drift"] - p.demand) / p.truth["driver"]["K1"]
    assert hidden.std() == pytest.approx(p.truth["effects"]["headway_drift"]["sd"], rel=0.05)
    assert abs(hidden.mean()) < 0.05
    a_second = round(1.0 / p.dt)
    assert (hidden[a_second:] - hidden[:-a_second]).std() < 0.3 * hidden.std()


def test_the_dead_time_grows() -> None:
    """Near the end the answer is the baseline's of a dead time that is longer by the stated rate."""
    p = drive("delay_drift", delay_drift={"rate": 0.3})
    d, s = p.truth["driver"], Seen(p)
    end = slice(round(0.9 * len(s.t)), None)
    longer = p._replace(
        truth={**p.truth, "driver": {**d, **{k: d[k] + 0.285 for k in ("dead_time1", "dead_time2")}}}
    )
    wrong, right = (q.demand[end] - answered(q, s.K1 * s.e, s.K2 * s.w)[end] for q in (p, longer))
    assert wrong.std() > 0.3
    assert right.std() < 0.1 * wrong.std()


# --- the pedal --------------------------------------------------------------------------------------


def test_the_foot_rests_while_the_driver_looks_away() -> None:
    p = drive("attention_gap", attention_gap={"per_minute": 2.0, "duration": 3.0})
    episodes, t = p.truth["episodes"]["attention_gap"], p.columns["t"]
    away = inside(p, "attention_gap") > 0
    for start, stop in episodes:
        one = away & (np.abs(t - 0.5 * (start + stop)) < 3.0) & (p.columns["brake"] == 0.0)
        assert 1.5 <= stop - start <= 6.0
        assert np.ptp(p.columns["pedal"][one]) == 0.0
    assert len(episodes) == 4
    np.testing.assert_allclose(p.demand[~away], p.without["attention_gap"][~away], atol=1e-9)


def test_the_foot_acts_and_waits() -> None:
    p = drive("act_and_wait", act_and_wait={"interval": 0.8})
    moves = np.flatnonzero(np.diff(p.demand)) + 1
    assert set(np.diff(moves)) == {40}
    np.testing.assert_allclose(p.demand[moves], p.without["act_and_wait"][moves], atol=1e-9)
    assert (
        np.isin(np.flatnonzero(np.diff(p.columns["pedal"]) * (1 - p.columns["brake"][1:])) + 1, moves).mean()
        > 0.9
    )


def test_a_second_lag_follows_the_first() -> None:
    p = drive("second_lag")
    a = math.exp(-p.dt / p.truth["effects"]["second_lag"]["tau"])
    x = p.without["second_lag"]
    slow = lfilter([0.5 * (1 - a), 0.5 * (1 - a)], [1.0, -a], x - x[0]) + x[0]
    assert (p.demand - x)[late(p)].std() > 0.2
    np.testing.assert_allclose(p.demand, slow, atol=1e-6)


def test_the_pedal_has_a_ceiling() -> None:
    p = drive("pedal_ceiling")
    level = p.truth["effects"]["pedal_ceiling"]["level"]
    assert p.columns["pedal"].max() == level
    assert 0.01 < (p.columns["pedal"] == level).mean() < 0.4
    np.testing.assert_array_equal(p.demand, np.minimum(p.without["pedal_ceiling"], level))


def test_backlash_is_a_play_of_its_width() -> None:
    """The pedal stays within half the width of the demand, and moves only at the edge of its play."""
    p = drive("backlash")
    half = 0.5 * p.truth["effects"]["backlash"]["width"]
    apart = p.without["backlash"] - p.demand
    assert np.abs(apart).max() <= half + 1e-9
    moved = np.flatnonzero(np.diff(p.demand)) + 1
    np.testing.assert_allclose(np.abs(apart[moved]), half, atol=1e-9)
    assert 0.2 < len(moved) / len(apart) < 0.95


def test_a_periodic_task_is_a_line() -> None:
    p = drive("periodic_task", periodic_task={"amplitude": 2.5, "frequency": 0.17})
    t, hidden = p.columns["t"], p.demand - p.without["periodic_task"]
    waves = np.column_stack([f(2.0 * np.pi * 0.17 * t) for f in (np.sin, np.cos)])
    size = np.linalg.lstsq(waves, hidden, rcond=None)[0]
    assert np.hypot(*size) == pytest.approx(2.5, rel=1e-6)
    np.testing.assert_allclose(waves @ size, hidden, atol=1e-6)


@pytest.mark.parametrize("name", sorted(set(STRENGTHS) & set(OUTSIDE)))
def test_effects_of_nobodys_list_are_there(name: str) -> None:
    """Each changes the demand by something that an engine could notice, here or in town."""
    size = 0.0
    for profile in ("mixed", "urban"):
        p = drive(name, profile=profile, noise="white")
        shown = p.columns["pedal"] - np.clip(p.without[name] + p.remnant, 0.0, 100.0)
        size = max(size, shown[(p.columns["brake"] == 0.0)].std())
        np.testing.assert_allclose(p.without[name], baseline(p), atol=0.02)
    assert size > 0.4


# --- masks -----------------------------------------------------------------------------------------


def test_a_controller_drives_for_a_while() -> None:
    p = drive("cruise_control", cruise_control={"share": 0.4}, minutes=4.0)
    c, on = p.columns, inside(p, "cruise_control")
    np.testing.assert_array_equal(c["cruise_active"], on)
    assert 0.3 < on.mean() < 0.5
    assert not c["pedal"][on > 0].any()
    assert c["speed"][on > 0].min() > 5.0


def test_gears_are_shifted_by_hand() -> None:
    p = drive("gear_shift", gear_shift={"per_minute": 4.0})
    c, on = p.columns, inside(p, "gear_shift")
    np.testing.assert_array_equal(c["clutch"], on)
    assert not c["pedal"][on > 0].any()
    assert c["accel"][on > 0].max() < 0.15  # slope and gusts: the engine is off
    assert not np.flatnonzero(np.diff(c["gear"]) * (on[1:] == 0)).size
    lengths = [stop - start for start, stop in p.truth["episodes"]["gear_shift"]]
    assert len(lengths) >= 6
    assert min(lengths) >= 0.4
    assert max(lengths) <= 1.0


def test_another_vehicle_cuts_in() -> None:
    p = drive("cut_in", cut_in={"per_minute": 1.0})
    jumps = p.columns["t"][np.flatnonzero(np.diff(p.columns["gap"]) < -3.0) + 1]
    assert len(jumps) == len(p.truth["episodes"]["cut_in"]) == 2
    np.testing.assert_allclose(jumps, [start for start, _ in p.truth["episodes"]["cut_in"]], atol=0.02)


def test_two_feet_on_two_pedals() -> None:
    p = drive("brake_overlap", brake_overlap={"per_minute": 2.0})
    on = inside(p, "brake_overlap") > 0
    assert p.columns["brake"][on].all()
    both = (p.columns["brake"] > 0) & (p.columns["pedal"] > 0)
    assert both.any()
    assert not both[~on].any()


# --- the car, by a second route --------------------------------------------------------------------


def slowly(x: Array, keep: Array) -> Array:
    """First-order lag (n,) of a pedal that is held over each step, `keep` (n,) of which stays at each step."""
    out, y = np.empty(len(x)), float(x[0])
    for k, (value, a) in enumerate(zip(x.tolist(), keep.tolist(), strict=True)):
        y = value + a * (y - value)
        out[k] = y
    return out


def expected_accel(p: Planted, name: str, how: dict[str, float]) -> Array:
    c, car, dt = p.columns, p.truth["car"], p.dt
    v = c["speed"] + 0.5 * dt * c["accel"]
    pedal, wind, less, factor, most = c["pedal"], 0.0, 0.0, 1.0, np.inf
    always = np.ones(len(v))
    if name == "pedal_map":
        pedal = pedal * (1.0 + how["curvature"] * (pedal / 20.0 - 1.0))
    elif name == "headwind":
        wind = how["speed"]
    elif name == "engine_braking":
        less = np.where(pedal < 2.0, how["strength"], 0.0)
    elif name == "gear_ratio":
        factor = 1.0 + how["share"] * (3.5 - c["gear"]) / 2.5
    elif name == "power_limit":
        most = how["power"] / v
    elif name == "actuator_lag":
        pedal = slowly(pedal, always * math.exp(-dt / how["tau"]))
    torque = slowly(pedal, always * math.exp(-dt / car["lag"]))
    if name == "turbo_lag":
        torque = slowly(torque, np.where(c["engine_speed"] < 2000.0, math.exp(-dt / how["tau"]), 0.0))
    # the mean over a step of what was reached at its end
    torque = 0.5 * (torque + np.concatenate([torque[:1], torque[:-1]]))
    drag = car["drag"] * (v + wind) ** 2
    return (
        np.minimum(car["power"] * factor * torque, most) - car["rolling"] - drag - less - 0.0981 * c["grade"]
    )


@pytest.mark.parametrize("name", ["", *EFFECTS["vehicle"]])
def test_the_car_moves_by_its_forces(name: str) -> None:
    """Without gusts and away from the brake, acceleration is what the forces give; without the effect it is not."""
    road = {"road_grade": {"sd": 1.0}} if name == "road_grade" else {"grade_sd": 0.8}
    p = drive(*[name] if name else [], seed=12, gust_sd=0.0, **road)
    c = p.columns
    quiet = np.convolve(c["brake"], np.ones(150))[: len(p.demand)] == 0.0
    quiet &= np.convolve(np.abs(np.diff(c["gear"], prepend=c["gear"][0])), np.ones(3), "same") == 0.0
    wrong = (c["accel"] - expected_accel(p, name, p.truth["effects"].get(name, {})))[quiet]
    assert quiet.mean() > 0.3
    assert np.abs(wrong[100:]).max() < 0.01
    if name == "road_grade":
        assert c["grade"].std() > 0.4
    elif name:
        plain = (c["accel"] - expected_accel(p, "", {}))[quiet]
        assert np.abs(plain).max() > 0.04


def test_height_is_the_sum_of_the_slopes() -> None:
    c = drive("road_grade").columns
    climbed = np.cumsum(c["speed"] * c["grade"] / 100.0) * 0.02
    np.testing.assert_allclose(c["altitude"] - climbed, c["altitude"][0] - climbed[0], atol=1e-6)
    assert np.ptp(c["altitude"]) > 1.0


def test_truth_can_be_written_down() -> None:
    p = drive("attention_gap", "radar_latency", "pedal_ceiling", noise="state")
    assert json.loads(json.dumps(p.truth, allow_nan=False))["effects"] == p.truth["effects"]
    assert {
        "simulator",
        "seed",
        "profile",
        "noise",
        "minutes",
        "driver",
        "car",
        "effects",
        "episodes",
    } <= set(p.truth)
