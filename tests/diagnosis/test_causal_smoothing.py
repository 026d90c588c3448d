"""What the driver could have known: nothing later, and no gain bent by the sensors' noise."""

from __future__ import annotations

import numpy as np
import pytest

from canid.models.diagnosis.causal_smoothing import Lagged, lagged
from canid.models.diagnosis.driver.driver_data import prepare
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

DT = 0.1


def reports(n: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gap, range rate and own speed as a radar and a car report them."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(n)
    rate = 0.8 * np.sin(0.4 * t) + 0.4 * np.sin(1.1 * t + 1)
    gap = 40 + np.cumsum(rate) * DT
    return gap + rng.normal(0, 0.15, n), rate + rng.normal(0, 0.1, n), 20 + rng.normal(0, 0.02, n)


def smoothed(of: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Lagged:
    """Estimates at ten lags."""
    new = np.r_[True, np.zeros(of[0].size - 1, dtype=bool)]
    return lagged(*of, new, 10, DT)


def test_coarse_steps_have_the_noise_of_rounding() -> None:
    """A gap that stands still between steps of 2 m, or a range rate between steps of 0.25 m/s, is as good as is stated."""
    gap, rate, speed = reports(3600, 3)
    t = DT * np.arange(3600)
    truth = 0.8 * np.sin(0.4 * t) + 0.4 * np.sin(1.1 * t + 1)
    for known in (
        smoothed((2.0 * np.round(gap / 2.0), rate, speed)),
        smoothed((gap, 0.25 * np.round(truth / 0.25), speed)),
    ):
        assert np.std(known.range_rate[:, 0] - truth) < 1.5 * known.range_rate_sd[0]


def test_nothing_later_than_now_enters() -> None:
    """Reports after t change no estimate at t, apart from the noise level, which is estimated from all reports."""
    before = reports(3600, 3)
    after = tuple(x.copy() for x in before)
    for x in after:
        x[3300:3400] = x[3300:3400][::-1] + 1.0
    first, second = smoothed(before), smoothed(after)
    for name in ("gap", "range_rate", "lead_accel"):
        change = np.abs(getattr(first, name) - getattr(second, name))
        assert change[:3300].max() < 2e-3
        assert change[3300:].max() > 0.1


def test_the_doubt_falls_with_what_is_reported_later() -> None:
    of = smoothed(reports(3000, 4))
    assert np.all(np.diff(of.range_rate_sd) < 0)
    assert np.all(np.diff(of.gap_sd) < 0)


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("seed", [21, 22])
@pytest.mark.parametrize("plant", [plant_one.plant, plant_two.plant])
def test_estimates_are_conditional_means(plant: object, seed: int) -> None:
    """The truth regressed on the estimate has slope 1, and the error has the stated standard deviation."""
    planted = plant({}, seed=seed, minutes=10, noise="ar1", profile="mixed")  # type: ignore[operator]
    measured = trace(planted)
    data = prepare(measured, np.ones(measured.t.size, dtype=bool))
    t, columns = planted.columns["t"], planted.columns
    lead = np.gradient(columns["speed"] + columns["range_rate"], planted.dt)
    k = 5
    at = slice(100, -100)
    for column, truth in ((data.known.range_rate, columns["range_rate"]), (data.known.lead_accel, lead)):
        there = np.interp(measured.t - k * measured.dt, t, truth)[at]
        here = column[at, k]
        slope = np.cov(there, here)[0, 1] / np.var(here)
        assert 0.93 < slope < 1.07
    missed = np.std(
        np.interp(measured.t - k * measured.dt, t, columns["range_rate"])[at] - data.known.range_rate[at, k]
    )
    assert 0.5 < missed / data.known.range_rate_sd[k] < 2.0
