"""A driver in a loop, written for these tests alone."""

import math

import numpy as np
import pytest

K, TAU, THETA = (4.4, 5.6), (0.685, 0.4), (0.3, 0.2)


def _ornstein(n, dt, T, rng):
    a, x = math.exp(-dt / T), rng.normal()
    out = np.empty(n)
    for k, w in enumerate(rng.normal(size=n) * math.sqrt(1 - a * a)):
        x = a * x + w
        out[k] = x
    return out


def _follow(seed, seconds=70.0, noise=1.0):
    """A driver (Grover 2021, case 1) behind a lead; vehicle v' = (0.8 (P-P0) - (v-v0)) / 20; at 100 Hz."""
    rng, dt = np.random.default_rng(seed), 0.01
    n = round(seconds / dt)
    slow = _ornstein(n, dt, 3.0, rng)
    lead, x = np.empty(n), 0.0
    for k in range(n):
        x += dt / 3.0 * (slow[k] - x)
        lead[k] = 25.0 + 2.2 * x
    pedal_noise = noise * _ornstein(n, dt, 1.0, rng)
    v, gap, x1, x2 = lead[0], 1.8 * lead[0], 0.0, 0.0
    headway_error, rate, pedal = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(n):
        headway_error[k], rate[k] = gap / v - 1.8, lead[k] - v
        x1 += (1 - math.exp(-dt / TAU[0])) * ((headway_error[k - 30] if k >= 30 else 0.0) - x1)
        x2 += (1 - math.exp(-dt / TAU[1])) * ((rate[k - 20] if k >= 20 else 0.0) - x2)
        pedal[k] = 20.0 + K[0] * x1 + K[1] * x2 + pedal_noise[k]
        v += dt * (0.8 * (pedal[k] - 20.0) - (v - 25.0)) / 20.0
        gap += dt * (lead[k] - v)
    return pedal[::10], np.column_stack([headway_error, rate])[::10]


@pytest.fixture(scope="session")
def ornstein():
    """The function that draws an Ornstein-Uhlenbeck process of variance one."""
    return _ornstein


@pytest.fixture(scope="session")
def follow():
    """The function that drives."""
    return _follow
