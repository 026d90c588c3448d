"""Gaussian noise models of the driver's remnant, and the filters that whiten them.

A noise model is a linear state-space model, so that the same matrices draw it exactly at any sampling step and whiten it
exactly: the Cramér-Rao bound needs the covariance, and a Kalman filter is its Cholesky factor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter, lfilter


class NoiseModel(NamedTuple):
    """Noise of variance one: shares of an Ornstein-Uhlenbeck process or a resonance, the rest white."""

    name: str
    time_constant: float = 0.0  # s of the Ornstein-Uhlenbeck process; 0: none
    frequency: float = 0.0  # Hz of the resonance; 0: none
    damping: float = 0.0
    white: float = 0.0  # share of the variance
    freedom: float = 0.0  # degrees of freedom of Student's t that its shocks are drawn from; 0: Gaussian


WHITE = NoiseModel("white", white=1.0)
# the five of the coverage row; the resonance is that of a hand on a wheel or of the pedal
NOISE_MODELS = (
    WHITE,
    NoiseModel("OU 0.5 s", time_constant=0.5),
    NoiseModel("OU 2 s", time_constant=2.0),
    NoiseModel("OU 1 s + white", time_constant=1.0, white=0.3),
    NoiseModel("resonant 0.6 Hz", frequency=0.6, damping=0.15),
)
HEAVY_TAILED = NoiseModel("OU 1 s, Student's t with 3", time_constant=1.0, freedom=3.0)
REMNANT = NoiseModel("OU 1 s", time_constant=1.0)


def model(noise: NoiseModel, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return F (k, k), stationary P (k, k) and h (k,) of x+ = F x + w, n = h x + white."""
    share = 1.0 - noise.white
    if noise.time_constant > 0.0:
        return np.array([[math.exp(-dt / noise.time_constant)]]), np.array([[share]]), np.ones(1)
    if noise.frequency > 0.0:
        w = 2.0 * math.pi * noise.frequency
        F = expm(np.array([[0.0, 1.0], [-w * w, -2.0 * noise.damping * w]]) * dt)
        return F, np.diag([share, share * w * w]), np.array([1.0, 0.0])
    return np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1)


def draw(noise: NoiseModel, n: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Draw (n,) noise of variance one, stationary from the first sample on.

    >>> bool(abs(draw(NOISE_MODELS[4], 200_000, 0.1, np.random.default_rng(0)).std() - 1.0) < 0.02)
    True
    """
    F, P, h = model(noise, dt)
    out = math.sqrt(noise.white) * rng.standard_normal(n)
    if not h.any():
        return out
    shocks = rng.standard_normal((n, len(h)))
    if noise.freedom > 2.0:
        shocks = rng.standard_t(noise.freedom, shocks.shape) * math.sqrt(1.0 - 2.0 / noise.freedom)
    drive = shocks @ np.linalg.cholesky(P - F @ P @ F.T + 1e-15 * P).T
    drive[0] = np.sqrt(np.diag(P)) * rng.standard_normal(len(h))
    if len(h) == 1:
        return out + lfilter([1.0], [1.0, -F[0, 0]], drive[:, 0])
    x = np.zeros(len(h))
    for k, d in enumerate(drive):
        x = F @ x + d if k else d
        out[k] += x[0]
    return out


def whiten(columns: np.ndarray, noise: NoiseModel, dt: float, seen: np.ndarray | None = None) -> np.ndarray:
    """Whiten (n, c) columns exactly, for noise of this model with variance one.

    Rows that are not `seen` (n,) come out as zero: nothing is known there.

    >>> n = draw(NOISE_MODELS[3], 5000, 0.1, np.random.default_rng(0))
    >>> e = whiten(n[:, None], NOISE_MODELS[3], 0.1)[:, 0]
    >>> bool(abs(e.std() - 1.0) < 0.03 and abs(np.corrcoef(e[1:], e[:-1])[0, 1]) < 0.05)
    True
    """
    F, P, h = model(noise, dt)
    if not h.any():
        out = columns / math.sqrt(noise.white)
        return out if seen is None else np.where(seen[:, None], out, 0.0)
    Q = P - F @ P @ F.T
    x = np.zeros((len(h), columns.shape[1]))
    out = np.zeros_like(columns, dtype=float)
    for k, row in enumerate(columns):
        if seen is not None and not seen[k]:
            x, P = F @ x, F @ P @ F.T + Q
            continue
        s = float(h @ P @ h) + noise.white
        e = row - h @ x
        out[k] = e / math.sqrt(s)
        gain = P @ h / s
        x = F @ (x + np.outer(gain, e))
        P = F @ (P - np.outer(gain, h @ P)) @ F.T + Q
    return out


def low_pass(n: int, dt: float, cut: float, rng: np.random.Generator, warm: float = 60.0) -> np.ndarray:
    """Draw (n,) second-order Butterworth low-pass noise below `cut` Hz, scaled to a standard deviation of one."""
    before = round(warm / dt)
    b, a = butter(2, 2.0 * cut * dt)
    x = lfilter(b, a, rng.standard_normal(n + before))[before:]
    return x / x.std()
