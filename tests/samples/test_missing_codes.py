"""Numbers that stand for "not measured" are left out where jumps alone lead to them, and what steps lead to never is."""

from __future__ import annotations

import numpy as np
import pytest

import canid
from canid.signals.samples import missing_codes
from canid.signals.samples.missing_codes import Watch, codes
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.types import Array, Trace
from tests import seeds

DT = 0.1
N = 3000
T = DT * np.arange(N)


def motion(seed: int) -> dict[str, Array]:
    """A drive behind a lead: sums of sines and noise, which no driver of canid's made."""
    rng = np.random.default_rng(seed)

    def sines(scale: float) -> Array:
        periods = rng.uniform(8.0, 40.0, 5)
        return scale * np.sum([np.sin(2 * np.pi * (T / p + rng.uniform())) for p in periods], axis=0)

    relative = sines(0.6)
    return {
        "speed": np.round(20.0 + sines(0.9) + 0.01 * rng.normal(size=N), 3),
        "range_rate": np.round(relative + 0.03 * rng.normal(size=N), 3),
        "gap": np.round(40.0 + np.cumsum(relative) * DT + 0.05 * rng.normal(size=N), 2),
        "pedal": np.round(np.clip(22.0 + sines(2.5) + 0.2 * rng.normal(size=N), 0.0, 100.0), 1),
    }


def places(seed: int, longest: int) -> Array:
    """Forty stretches of up to so many rows."""
    rng = np.random.default_rng(seed)
    at = np.zeros(N, bool)
    for begin in rng.choice(np.arange(200, N - 50, 60), 40, replace=False):
        at[begin : begin + rng.integers(1, longest + 1)] = True
    return at


def drive(signals: dict[str, Array]) -> Trace:
    units = {"speed": "m/s", "range_rate": "m/s", "gap": "m", "pedal": "%"}
    part = slice(1500)
    return canid.from_arrays(time=T[part], **{role: x[part] for role, x in signals.items()}, units=units)


@pytest.mark.parametrize(("number", "longest"), [(-1.0, 1), (0.0, 30), (255 / 3.6, 5)])
def test_no_speed_that_a_car_cannot_jump_to_is_in_the_samples(number: float, longest: int, seed: int) -> None:
    """In single rows and in stretches of up to 3 s; the pedal is not called a throttle for it."""
    signals = motion(seed)
    truth = signals["speed"].copy()
    signals["speed"] = np.where(places(seed, longest), number, truth)
    trace = drive(signals)
    error = trace.signals["speed"] - np.interp(trace.t + T[0], T, truth)
    assert np.nanmax(np.abs(error)) < 0.5
    assert not [each.name for each in trace.findings if each.withholds]


@pytest.mark.parametrize("number", [0.0, -1.0, 2.0])
def test_a_range_rate_of_one_number_in_scattered_rows_stands_for_none(number: float, seed: int) -> None:
    """Once it is known, and wherever it is farther away than a step; the same number within the motion is measured."""
    truth = motion(seed)["range_rate"]
    at = places(seed, 1)
    value = np.where(at, number, truth)
    none = codes(Watch(), "range_rate", T, value)[1]
    far = at & (np.abs(number - truth) > 0.5)
    assert not (none & ~at & (np.abs(number - truth) > 0.5)).any()
    assert none[far][10:].mean() > 0.9
    assert not codes(Watch(), "range_rate", T, truth)[1].any()


@pytest.mark.parametrize("step", [1e-3, 0.1, 1 / 3.6, 0.5, 5 / 3.6])
@pytest.mark.parametrize("rate", [1.0, 2.0, 5.0, 10.0, 50.0])
@seeds.mostly(0.98)
def test_a_car_that_brakes_to_a_stop_is_measured(step: float, rate: float, seed: int) -> None:
    """With up to 9 m/s², in steps of up to 5 km/h, at 1 to 50 Hz; also where a slow sensor's value is repeated."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 200.0, 0.02)
    speed, v, goal, accel = np.zeros(len(t)), 0.0, 0.0, 2.0
    for k in range(len(t)):
        if rng.uniform() < 0.0008:
            goal, accel = (
                rng.choice([0.0, 8.0, 14.0, 25.0]),
                rng.uniform(1.0, 3.0 if rng.uniform() < 0.6 else 9.0),
            )
        v += np.clip(goal - v, -0.02 * accel, 0.02 * min(accel, 3.0))
        speed[k] = v
    every = round(50 / rate)
    seen = np.round((speed + (speed > 0.3) * 0.02 * rng.normal(size=len(t))) / step) * step
    held = np.repeat(seen[::every], every)[: len(t)] if rate >= 2.0 else seen
    for stamps, value in ((t[::every], seen[::every]), (t[::2], held[::2])):
        assert not codes(Watch(), "speed", stamps, value)[1].any()


@pytest.mark.parametrize("step", [0.01, 0.1, 0.25, 0.5])
@seeds.mostly(0.98)
def test_a_range_rate_of_leads_that_change_is_measured(step: float, seed: int) -> None:
    """Coarse, limited at 0.8 m/s on both sides or not, and at rest behind a lead that stands."""
    rng = np.random.default_rng(seed)
    relative = motion(seed)["range_rate"]
    for begin in rng.integers(100, N - 100, 12):
        relative[begin:] += rng.normal(0.0, 2.0) - relative[begin]
    relative[1000:1200] = 0.0
    for value in (relative, np.clip(relative, -0.8, 0.8)):
        assert not codes(Watch(), "range_rate", T, np.round(value / step) * step)[1].any()


def test_a_pedal_beyond_its_range_is_a_stop_or_no_value(seed: int) -> None:
    """102 % amid 20 % stands for none from the fourth time on; a kick-down to 102 % does not, nor do 0 and 100 %."""
    rng = np.random.default_rng(seed)
    truth = motion(seed)["pedal"]
    at = places(seed, 4)
    none = codes(Watch(), "pedal", T, np.where(at, 102.0, truth))[1]
    assert none[at][24:].all()
    assert not none[~at].any()
    for low, high in ((0.0, 100.0), (-1.0, 102.0)):
        pressed = truth.copy()
        for begin in rng.integers(100, N - 200, 12):
            shape = np.interp(np.arange(40), [0, 4, 30, 34], [20.0, rng.choice([-30.0, 140.0]), 100.0, 20.0])
            pressed[begin : begin + 40] = shape
        assert not codes(Watch(), "pedal", T, np.clip(pressed, low, high))[1].any()


@pytest.mark.parametrize("cut", [1, 7, 500])
def test_the_chunks_do_not_matter(cut: int, seed: int) -> None:
    """Neither to the readings nor to the counts."""
    signals = motion(seed)
    rate = np.where(places(seed, 5), 0.0, signals["range_rate"])
    speed = np.where(places(seed + 1, 5), -1.0, signals["speed"])

    def read(size: int) -> tuple[Array, dict[str, int]]:
        state, out, total = missing_codes.init(), [], dict[str, int]()
        for begin in range(0, 1000, size):
            part = slice(begin, min(begin + size, 1000))
            rows = np.arange(part.stop - part.start)
            readings = (
                RoleReadings("range_rate", rows, rate[part]),
                RoleReadings("speed", rows, speed[part]),
            )
            state, decoded, counts = missing_codes.step(state, Decoded(readings, (), ()), T[part])
            out.append(np.stack([each.value for each in decoded.roles]))
            for says, n in counts.items():
                total[says] = total.get(says, 0) + n
        return np.concatenate(out, axis=1), total

    whole, counts = read(1000)
    parts, again = read(cut)
    np.testing.assert_array_equal(whole, parts)
    assert counts == again
