"""A driver behind a lead, written for these tests alone, as a stream of samples."""

import functools
import math

import numpy as np
import pytest

from canid.values.types import LearnGate, Sample

DT = 0.1
NAMES = ("headway_error", "range_rate")


@functools.lru_cache(maxsize=8)
def _drive(seed, seconds):
    """Driver K1 4.4, tau1 0.685, theta1 0.3, K2 5.6, tau2 0.4, theta2 0.2; pedal noise OU 1 s; at 50 Hz."""
    rng, h = np.random.default_rng(seed), 0.02
    n = round(seconds / h)
    v, gap, x1, x2, noise, goal, lead = 25.0, 45.0, 0.0, 0.0, 0.0, 0.0, 25.0
    errors, rates, rows = [0.0] * 16, [0.0] * 11, []
    for k in range(n):
        goal += -h / 4.0 * goal + 2.6 * math.sqrt(2 * h / 4.0) * rng.normal()
        lead += h / 2.0 * (25.0 + goal - lead)
        noise += -h * noise + math.sqrt(2 * h) * rng.normal()
        error, rate = gap / v - 1.8, lead - v
        errors, rates = [*errors[1:], error], [*rates[1:], rate]
        x1 += (1 - math.exp(-h / 0.685)) * (errors[0] - x1)
        x2 += (1 - math.exp(-h / 0.4)) * (rates[0] - x2)
        pedal = 25.0 + 4.4 * x1 + 5.6 * x2 + noise
        if k % 5 == 0:
            rows.append((pedal, error, rate))
        v += h * (0.8 * (pedal - 25.0) - (v - 25.0)) / 20.0
        gap += h * (lead - v)
    return tuple(rows)


def drive(seed=0, seconds=90.0, shut=(), gate=LearnGate.CRUISE):
    """Samples at 10 Hz; the gate is shut in the intervals (start, stop) of `shut` [s]."""
    out = []
    for k, (pedal, error, rate) in enumerate(_drive(seed, seconds)):
        t = round(k * DT, 9)
        g = gate if any(a <= t < b for a, b in shut) else LearnGate.OPEN
        out.append(Sample(t, pedal, (error, rate), g, g is LearnGate.OPEN, 0, {}))
    return out


def run(estimator, samples, state=None):
    """All estimates, and the last state."""
    state = estimator.init() if state is None else state
    out = []
    for sample in samples:
        state, estimate = estimator.step(state, sample)
        if estimate is not None:
            out.append(estimate)
    return out, state


@pytest.fixture(scope="session")
def driven():
    """The function `drive`."""
    return drive


@pytest.fixture(scope="session")
def estimates():
    """The function `run`."""
    return run
