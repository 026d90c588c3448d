"""The grid of steering follows the instants at which the wheel angle is updated, and shows what was planted there."""

from __future__ import annotations

import random

import numpy as np
import pytest

from canid.mathematics.identification.first_order import scan
from canid.models.pipeline import pipeline
from canid.models.simulation import frames
from canid.models.simulation.car import Car
from canid.models.simulation.lane import Steering, keep_lane
from canid.signals.samples import local_polynomial, update_instants
from canid.signals.vehicle import read_vehicle
from canid.values.frame_columns import columns_of
from canid.values.types import Sample
from tests.exact import exact

DT = 0.1
SECONDS = 21.0


def decided(kind: str, rng: np.random.Generator, late: float, period: float, step: float = 0.0):
    """Readings of a driver who decides every DT: times, values, and the decisions."""
    decisions = np.cumsum(rng.normal(size=round(SECONDS / DT) + 3))
    t = np.arange(rng.uniform(0.0, period), SECONDS, period)
    t = np.sort(t + rng.uniform(0.0, 2e-4, len(t)))
    at = late - DT + DT * np.arange(len(decisions))
    held = decisions[np.searchsorted(at, t, side="right") - 1]
    value = held if kind == "hold" else np.interp(t, at, decisions)
    return t, step * np.round(value / step) if step else value, at, decisions


def grid_of(t, value):
    return update_instants.step(update_instants.init(), t, value, t, float(t[-1]), DT).grid


@pytest.mark.parametrize("kind", ["hold", "line"])
@pytest.mark.parametrize("period", [0.01, 0.02, 0.03])
def test_the_phase_of_the_instants_is_found(kind: str, period: float, seed: int) -> None:
    """To a quarter of the readings' period, for values that are held as for lines; in the second block and later."""
    rng = np.random.default_rng(seed)
    late = rng.uniform(0.0, DT)
    grid = grid_of(*decided(kind, rng, late, period, step=0.05)[:2])
    assert {one.kind for one in grid} == {kind}
    for one in grid[1:]:
        off = (one.phase - late + DT / 2) % DT - DT / 2
        assert abs(off) <= (period if kind == "hold" else period / 4)


@pytest.mark.parametrize("kind", ["hold", "line"])
def test_a_value_at_an_instant_is_the_decision(kind: str, seed: int) -> None:
    """Whatever the clocks of driver and sender, where joining by lines is off by a share of the next decision."""
    rng = np.random.default_rng(seed)
    t, value, at, decisions = decided(kind, rng, rng.uniform(0.0, DT), 0.02)
    last = grid_of(t, value)[-1]
    wrong = []
    for k in range(round(11.0 / DT), round(19.0 / DT)):
        now = k * DT + last.phase
        near = np.abs(t - now) < DT
        found = update_instants.value_at(t[near], value[near], now, last.kind, DT).value
        truth = decisions[np.abs(at - now).argmin()]
        wrong.append((found - truth, float(np.interp(now, t, value)) - truth))
    own, joined = np.sqrt(np.mean(np.square(wrong), axis=0))
    assert own < 0.03
    assert kind == "line" or joined > 3.0 * own


def test_a_signal_without_instants_is_read_at_its_readings(seed: int) -> None:
    """A smooth wheel shows none: then the sender's period is the grid where it divides the step, and else nothing is."""
    rng = np.random.default_rng(seed)
    for period, kind in ((0.02, "reading"), (0.1, "reading"), (0.03, "none")):
        t = np.arange(rng.uniform(0.0, period), SECONDS, period)
        smooth = sum(np.sin(w * t + rng.uniform(0.0, 6.0)) for w in (0.7, 1.9, 3.1))
        grid = grid_of(t, smooth + 0.01 * rng.normal(size=len(t)))
        assert {one.kind for one in grid} == {kind}
        if kind == "reading":
            off = (grid[-1].phase - t[0] + period / 2) % period - period / 2
            assert abs(off) < 1e-6


@pytest.mark.parametrize("period", [0.05, 0.02])
def test_a_wheel_that_comes_to_its_lock_shows_no_instants(period: float) -> None:
    """A smooth wheel that stays at its lock is read at its readings: no value of the grid is beyond all of them."""
    for seed in range(6):
        rng = np.random.default_rng([seed, 46])
        angle = scan(scan(rng.normal(size=3000), np.array([0.98])), np.array([0.95]))
        wheel = np.clip(2.0 * angle / angle.std(), -1.0, 1.0)[:: round(period / 0.01)]
        t, value = period * np.arange(len(wheel)), 0.1 * np.round(wheel / 0.1)
        assert {one.kind for one in grid_of(t, value)} == {"reading"}


def test_a_wheel_that_stands_still_keeps_the_grid() -> None:
    """Straight driving, and a sensor that is silent, leave the instants as they were."""
    rng = np.random.default_rng(3)
    t, value, *_ = decided("line", rng, 0.037, 0.02)
    value[t > 9.0] = value[t > 9.0][0]
    grid = grid_of(t, value)
    assert [one.kind for one in grid] == ["line"] * 4
    assert grid[-1].phase == grid[1].phase
    state = update_instants.step(update_instants.init(), t, value, t, 1e9, DT)
    assert len(state.grid) < 10


@pytest.mark.slow("whole logs")
def test_steering_does_not_depend_on_chunks(seed: int) -> None:
    """Samples of a lane drive are the same to the last bit however its frames are divided."""
    car, drive = read_vehicle("generic_lane"), keep_lane(0.5, seed % 10_000, Steering(), Car(), {}, ())
    said = frames(drive, car)
    built, rng = pipeline.build(car, estimating=False), random.Random(seed)
    seen = []
    for sizes in ((len(said),), (1, 3, 40), (200, 900)):
        state, out, k = built.init(), [], 0
        while k < len(said):
            size = rng.choice(sizes)
            state, more = built.step(state, columns_of(said[k : k + size]))
            out += [exact(x) for _, x in more if isinstance(x, Sample)]
            k += size
        seen.append(out)
    assert seen[0] == seen[1] == seen[2]
    assert len(seen[0]) > 200


def test_the_parabola_is_that_of_least_squares(seed: int) -> None:
    """Value and variance at 0 are numpy's."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(-1.0, 1.0, 9))
    x[0], x[-1] = -1.0, 1.0
    y = 30.0 + x - x**2 + 0.1 * rng.normal(size=9)
    X = np.vander(x, 3, increasing=True)
    w, rest, *_ = np.linalg.lstsq(X, y, rcond=None)
    found = local_polynomial.parabola(x.tolist(), y.tolist())
    assert found.value == pytest.approx(w[0])
    assert found.variance == pytest.approx(rest[0] / 6 * np.linalg.inv(X.T @ X)[0, 0])


@pytest.mark.parametrize("period", [0.01, 0.02])
def test_rounding_hides_no_phase(period: float) -> None:
    """A wheel angle that moves by 15 steps of its rounding shows its corners in every block, at 100 Hz as at 50 Hz."""
    kinds, off = [], []
    for seed in range(8):
        rng = np.random.default_rng([seed, 6])
        late, n = rng.uniform(0.0, DT), round(60.0 / DT) + 3
        angle = scan(scan(rng.normal(size=n), np.array([0.9])), np.array([0.6]))
        t = np.arange(rng.uniform(0.0, period), 60.0, period)
        value = 0.1 * np.round(np.interp(t, late - DT + DT * np.arange(n), 1.5 * angle / angle.std()) / 0.1)
        for one in grid_of(t, value):
            kinds.append(one.kind)
            off.append((one.phase - late + DT / 2) % DT - DT / 2)
    assert set(kinds) == {"line"}
    assert np.abs(off).mean() < 0.0015
