"""The response to what is known only in hindsight: it bends no gain, whatever the noise that it is fitted with."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from canid.models.diagnosis.causal_smoothing import OF_LEAD, followed
from canid.models.diagnosis.driver.driver_model import delayed, lagged
from canid.models.diagnosis.driver.known_response import known_response
from canid.values.types import Array
from tests import seeds

DT = 0.1


def lead(seed: int, n: int, jerk: float = 0.1, memory: float = 5.0) -> tuple[Array, Array]:
    """A lead's acceleration, and what is known of it: columns by lag. (m/s³)²·s, and s in which it fades."""
    rng = np.random.default_rng(seed)
    accel = lfilter([1.0], [1.0, -np.exp(-DT / memory)], rng.normal(0.0, np.sqrt(jerk * DT), n))
    mean = 0.5 * (accel + np.r_[accel[0], accel[:-1]])
    speed = 20.0 + np.cumsum(mean) * DT + rng.normal(0.0, rng.uniform(0.05, 0.15), n)
    known = followed(np.full(n, np.nan), speed, np.r_[True, np.zeros(n - 1, dtype=bool)], 15, DT, OF_LEAD)
    return accel, np.asfortranarray(known.x[:, :, 2].T)


@pytest.mark.parametrize("A", [[1.0], [1.0, -0.9], [1.0, -0.5, 0.2, *[0.02] * 20]])
def test_of_what_is_known_at_once_it_is_the_lag(A: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.normal(size=300)) + 50.0
    lags = np.stack([np.r_[np.full(k, x[0]), x[: 300 - k]] for k in range(15)], axis=1)
    theta, tau = float(rng.uniform(0.0, 1.1)), float(rng.uniform(0.0, 2.0))
    found = known_response(lags, theta, tau, DT, np.array(A))
    assert found is not None
    np.testing.assert_allclose(found, lagged(delayed(x, theta, DT), tau, DT), atol=1e-9)


@pytest.mark.parametrize("jerk", [0.17, 0.55, 1.7])
def test_it_bends_no_gain_however_lively_the_lead_is(jerk: float, seed: int) -> None:
    """Of motions in steps of 3 the nearest one bent the gain in a pedal's noise by up to a tenth."""
    A, worst = np.array([1.0, -0.9]), 0.0
    for k in range(4):
        accel, lags = lead(seed + k, 6_000, jerk, memory=2.0)
        found = known_response(lags, 0.15, 0.45, DT, A)
        assert found is not None
        regressor, output = (
            lfilter(A, [1.0], x)[50:] for x in (found, lagged(delayed(accel, 0.15, DT), 0.45, DT))
        )
        worst = max(worst, abs(float(regressor @ output / (regressor @ regressor)) - 1.0))
    assert worst < 0.05


@seeds.mostly(0.9)
def test_it_bends_no_gain(seed: int) -> None:
    """By white noise and by that of a pedal; the response as it was known at each time was 5 to 15 % too small."""
    rng = np.random.default_rng(seed)
    accel, lags = lead(seed, 12_000)
    theta, tau = float(rng.uniform(0.05, 0.2)), float(rng.uniform(0.3, 0.6))
    truth = lagged(delayed(accel, theta, DT), tau, DT)
    for A in (np.ones(1), np.array([1.0, -0.9])):
        found = known_response(lags, theta, tau, DT, A)
        assert found is not None
        regressor, output = (lfilter(A, [1.0], x)[50:] for x in (found, truth))
        gain = float(regressor @ output / (regressor @ regressor))
        assert 0.97 < gain < 1.03
