"""Worlds without feedback: a driver of known truth answers an input that the answer does not change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from benchmarks.identification.noise_models import NoiseModel, draw, low_pass
from tests.plants.first_order_lag import answer

# Chen & Ulsoy 2001, Table 1, means; c1 is not published, -0.5 as in reference/identification.md
A = np.array([1.0, -1.2623, 0.3697])
B = np.array([0.0, 4.134, -4.0337])
C = np.array([1.0, -0.5])
TABLE1 = np.array([A[1], A[2], B[1], B[2], C[1]])
TABLE1_DT = 0.1


class Armax(NamedTuple):
    """One run of Chen & Ulsoy's driver."""

    y: np.ndarray  # (n,) deg
    u: np.ndarray  # (n,) m
    sigma: float  # of the innovations


def table1(
    seed: int, n: int, decibel: float, gain: np.ndarray | None = None, active: np.ndarray | None = None
) -> Armax:
    """Draw A y = g B u + C e at 10 Hz, input below 0.5 Hz with sd 0.3 m, var(G u) / var(H e) as given.

    Args:
        seed: of the run.
        n: samples.
        decibel: signal to noise.
        gain: (n,) factor on B over time; None: one.
        active: (n,) factor on the input over time; None: one.
    """
    rng = np.random.default_rng([seed, 1])
    before = 300  # samples: 30 s, after which the start is forgotten to 1e-6
    u = 0.3 * low_pass(n + before, TABLE1_DT, 0.5, rng)
    e = rng.standard_normal(n + before)
    signal, noise = lfilter(B, A, u), lfilter(C, A, e)
    sigma = float(signal[before:].std() / noise[before:].std() * 10.0 ** (-decibel / 20.0))
    if active is not None:
        u[before:] *= active
    drive = lfilter(B, [1.0], u)
    if gain is not None:
        drive[before:] *= gain
    y = lfilter([1.0], A, drive) + sigma * noise
    return Armax(y[before:], u[before:], sigma)


class Process(NamedTuple):
    """One run of a driver with lag and dead time."""

    y: np.ndarray  # (n,)
    u: np.ndarray  # (n,)
    dt: float
    K: float
    tau: float
    dead_time: float
    sigma: float  # of the noise
    noise: NoiseModel
    settle: int  # samples before which the history is not long enough


class Case(NamedTuple):
    """What one run of `process` is drawn from; Grover's first driver by default."""

    noise: NoiseModel
    cut: float = 0.2  # Hz, bandwidth of the input
    K: float = 4.4
    tau: float = 0.685  # s
    dead_time: float = 0.3  # s
    decibel: float = 20.0
    seconds: float = 20.0


# s of history before the window; canid drops as much (tau_max + dead_time_max) so that all use the same samples
HISTORY = 4.5


def process(seed: int, case: Case, dt: float = 0.01, every: int = 1) -> Process:
    """Draw y = K G u + noise, u below `cut` Hz with sd 0.3, made at `dt` and handed out at every `every`-th sample."""
    rng = np.random.default_rng([seed, 2])
    n = round((case.seconds + HISTORY) / dt)
    u = 0.3 * low_pass(n, dt, case.cut, rng)
    x = case.K * answer(u, dt, case.tau, case.dead_time)
    sigma = float(x[round(HISTORY / dt) :].std() * 10.0 ** (-case.decibel / 20.0))
    x, u = x[::every], u[::every]
    y = x + sigma * draw(case.noise, len(x), dt * every, rng)
    settle = round(HISTORY / (dt * every))
    return Process(y, u, dt * every, case.K, case.tau, case.dead_time, sigma, case.noise, settle)
