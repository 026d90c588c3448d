"""What is at the pedal's floor is a bound of the demand: no gain is bent by which samples were masked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.special import log_ndtr

from canid.mathematics.identification import censoring
from canid.mathematics.identification.first_order import scan
from canid.mathematics.identification.fopdt.fopdt_fit import fit_process


@pytest.mark.parametrize("bound", [-6.0, -1.0, 0.0, 1.5, 4.0])
def test_the_parabola_follows_the_likelihood(bound: float) -> None:
    """Slope and curvature of -weight (value - s)^2 / 2 at s = 0 are those of log Phi(bound - s)."""
    (value,), (weight,), _ = censoring.below(np.array([bound]))
    h = 1e-3
    a, b, c = (float(log_ndtr(bound - s)) for s in (-h, 0.0, h))
    assert weight * value == pytest.approx((c - a) / (2 * h), rel=1e-4, abs=1e-9)
    assert -weight == pytest.approx((c - 2 * b + a) / h**2, rel=1e-3, abs=1e-6)


class Floored(NamedTuple):
    """A driver whose demand is below the floor for a good part of the time."""

    y: np.ndarray
    u: np.ndarray
    usable: np.ndarray
    bound: np.ndarray
    demand: np.ndarray


def floored(seed: int) -> Floored:
    """Draw one; the gain is 5. The input is smooth: what is faster than 1.3 Hz is taken for noise (input_noise.py)."""
    rng = np.random.default_rng([seed, 9])
    n = 3000
    u = scan(0.35 * rng.normal(size=n), np.array([0.93]))
    for _ in range(2):
        u = scan(0.2 * u, np.array([0.8]))
    u *= 0.95 / u.std()
    x = scan(0.2 * u, np.array([0.8]))
    demand = 2.4 + 5.0 * np.roll(x, 3) + scan(0.6 * rng.normal(size=n), np.array([0.9]))
    free = demand > 0.5
    # as the gate does: three samples after the floor are not learnt from
    usable = free & np.roll(free, 1) & np.roll(free, 2) & np.roll(free, 3)
    return Floored(np.maximum(demand, 0.0), u, usable, np.where(free, np.nan, 0.5), demand)


@pytest.mark.slow("fits many drives")
def test_bounds_take_the_selection_out() -> None:
    """Masked alone the gain is a standard deviation below that of the whole demand; with bounds a third of that."""
    z: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(20):
        y, u, usable, bound, demand = floored(seed)
        assert 0.2 < np.isfinite(bound).mean() < 0.6
        whole = fit_process(demand, u[:, None], np.full(len(y), True), 0.1).channels[0].K.value
        for given in z:
            fit = fit_process(y, u[:, None], usable, 0.1, bound=bound if given else None)
            K = fit.channels[0].K
            z[given].append(3.92 * (K.value - whole) / (K.high - K.low))
    assert np.mean(z[False]) < -1.0, z
    assert abs(np.mean(z[True])) < abs(np.mean(z[False])) / 3.0, z


def test_a_bound_far_above_the_demand_says_nothing() -> None:
    """Bounds that the demand never came near change no number by more than a hundredth of its interval."""
    y, u, usable, bound, _ = floored(3)
    far = np.where(np.isfinite(bound), 60.0, np.nan)
    plain, given = (fit_process(y, u[:, None], usable, 0.1, bound=b).channels[0].K for b in (None, far))
    assert abs(plain.value - given.value) < 0.02 * (plain.high - plain.low)
