"""Samples are what a direct interpolation of the readings gives, whatever the order and rates in which they come."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid import read_vehicle
from canid.signals.samples import sampler, sampling_grid
from canid.signals.samples.sampling_grid import Points, Readings, Role
from canid.values.types import Reading

ROLES = {"speed": Role(needed=True), "pedal": Role(needed=True), "brake": Role(switch=True, stale=3.0)}


def run(readings: list[Reading], end: float, seed: int = 1) -> dict[str, np.ndarray]:
    """The samples of these readings, each in a frame of its own, in chunks of 1 to 60 frames."""
    readings, rng = sorted(readings), np.random.default_rng(seed)
    state, parts, k = sampling_grid.init(), [], 0
    while k < len(readings):
        chunk = readings[k : k + int(rng.integers(1, 60))]
        by_role = {
            role: Readings(*(np.array(x) for x in zip(*rows, strict=True)))
            for role in ROLES
            if (rows := [(r.t, r.value, k + i) for i, r in enumerate(chunk) if r.role == role])
        }
        state = sampling_grid.put(state, by_role)
        state, ready = sampling_grid.take(state, np.array([r.t for r in chunk]), 0.1, ROLES)
        parts += ready
        k += len(chunk)
    state, ready = sampling_grid.take(state, np.array([end]), 0.1, ROLES)
    return joined([*parts, *ready])


def joined(parts: list[Points]) -> dict[str, np.ndarray]:
    columns = {role: np.concatenate([points.values[role] for points in parts]) for role in ROLES}
    return columns | {"t": np.concatenate([points.t for points in parts])}


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.008, 0.12), st.floats(0.008, 0.12))
def test_numbers_are_interpolated_by_timestamp(seed: int, every: float, other: float) -> None:
    """Equal to numpy's interpolation at every grid point, for two clocks with jitter."""
    rng = np.random.default_rng(seed)
    clocks = {}
    for role, period in (("speed", every), ("pedal", other)):
        t = np.arange(0.0, 8.0, period)
        clocks[role] = np.maximum.accumulate(t + 0.2 * period * rng.random(t.size)) + 1e-9 * np.arange(t.size)
    waves = {role: np.sin(t) for role, t in clocks.items()}
    readings = [
        Reading(float(t), role, float(x))
        for role, times in clocks.items()
        for t, x in zip(times, waves[role], strict=True)
    ]
    got = run(readings, 8.0, seed)
    assert got["t"].size >= 70
    for role, times in clocks.items():
        inside = (got["t"] >= times[0]) & (got["t"] <= times[-1])
        expected = np.interp(got["t"][inside], times, waves[role])
        np.testing.assert_allclose(got[role][inside], expected, atol=1e-12)


def test_a_role_that_stops_is_not_measured() -> None:
    readings = [Reading(0.02 * k, "speed", 1.0) for k in range(500)]
    readings += [Reading(0.02 * k, "pedal", 2.0) for k in range(100)]
    got = run(readings, 10.0)
    pedal = dict(zip(np.round(got["t"], 6).tolist(), got["pedal"], strict=True))
    assert pedal[1.9] == 2.0
    assert np.isnan(pedal[2.6])
    assert np.isfinite(got["speed"]).all()


def test_nothing_is_drawn_across_a_hole() -> None:
    """Two readings a second apart say nothing about the time between."""
    readings = [Reading(0.02 * k, "speed", 1.0) for k in range(500)]
    readings += [Reading(0.02 * k, "pedal", 2.0) for k in range(500) if not 100 < k < 150]
    got = run(readings, 10.0)
    hole = (got["t"] > 2.01) & (got["t"] < 2.99)
    assert np.isnan(got["pedal"][hole]).all()
    assert np.isfinite(got["pedal"][~hole][:-1]).all()


def test_nan_is_not_interpolated_away() -> None:
    readings = [Reading(0.05 * k, "speed", float("nan") if k == 20 else 1.0) for k in range(100)]
    readings += [Reading(0.05 * k, "pedal", 1.0) for k in range(100)]
    got = run(readings, 5.0)
    assert np.isnan(got["speed"][got["t"] == 1.0]).all()


def test_switches_are_held() -> None:
    readings = [Reading(0.02 * k, role, 1.0) for k in range(300) for role in ("speed", "pedal")]
    readings += [Reading(1.05, "brake", 0.0), Reading(2.05, "brake", 1.0)]
    got = run(readings, 6.0)
    brake = dict(zip(np.round(got["t"], 6).tolist(), got["brake"], strict=True))
    assert np.isnan(brake[1.0])
    assert (brake[1.1], brake[2.0], brake[2.1], brake[5.0]) == (0.0, 0.0, 1.0, 1.0)
    assert np.isnan(brake[5.2])


def test_a_long_pause_is_jumped() -> None:
    """An hour without frames does not make 36,000 empty samples."""
    readings = [
        Reading(0.05 * k + shift, role, 1.0)
        for shift in (0.0, 3600.0)
        for k in range(100)
        for role in ("speed", "pedal")
    ]
    got = run(readings, 3605.0)
    assert got["t"].size < 400
    assert np.isfinite(got["speed"][got["t"] > 3600.1]).all()


@pytest.mark.parametrize(("noise", "most"), [(0.02, 0.72), (0.04, 0.55), (0.08, 0.45)])
def test_the_parabola_through_a_speed_is_as_wide_as_its_noise_asks(
    noise: float, most: float, seed: int
) -> None:
    """Error over noise at 10 Hz, where a vehicle moves as in traffic; however the readings are cut into chunks."""
    rng, t = np.random.default_rng(seed), 0.1 * np.arange(1200)
    speed = 20.0 + 1.5 * np.sin(0.6 * t) + 0.3 * np.sin(1.5 * t)
    roles = {
        "own_speed": sampler.sampled_roles(read_vehicle("generic"))["own_speed"],
        "gap": Role(needed=True),
    }
    # each frame brings a speed, and the gap of 1.6 s before, as the lead's smoothing does
    reading = Readings(t, speed + noise * rng.standard_normal(t.size), np.arange(t.size))
    late = reading._replace(t=t - 1.6)
    got = []
    for size in (1200, 7):
        state, values = sampling_grid.init(), []
        for k in range(0, t.size, size):
            part = slice(k, k + size)
            came = {
                "own_speed": Readings(*(x[part] for x in reading)),
                "gap": Readings(*(x[part] for x in late)),
            }
            state, ready = sampling_grid.take(sampling_grid.put(state, came), t[part], 0.1, roles)
            values += [x for points in ready for x in points.values["own_speed"].tolist()]
        got.append(values)
    whole, cut = got
    assert cut == whole[: len(cut)]
    assert len(cut) > 1100
    error = np.array(cut)[20:] - speed[20 : len(cut)]
    assert error.std() < most * noise
