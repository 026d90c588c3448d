"""The driver's own noise: filtered white noise of unit variance, by exact sampling of each process."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from tests.plants.planted_drive import NOISES, Array

# s; the leg has mass: "white" noise of the pedal is white up to some 5 Hz, so white at the 10 Hz of the estimators
WHITE_TIME_CONSTANT_S = 0.03
TIME_CONSTANT_S = {"white": WHITE_TIME_CONSTANT_S, "ar1": 1.0, "state": 1.0, "ar4": 4.0}  # s
RESONANCE_HZ = 0.25  # Hz
DAMPING = (0.3, 0.5)
WHITE_SHARE = 0.3  # of the variance of "mix"


def unit_remnant(kind: str, n: int, dt: float, damping: float, rng: np.random.Generator) -> Array:
    """Draw (n,) noise of unit variance; "state" is autocorrelated here and grows in the loop.

    >>> x = unit_remnant("ar1", 200_000, 0.01, 0.4, np.random.default_rng(3))
    >>> bool(abs(x.std() - 1.0) < 0.1)
    True
    """
    if kind not in NOISES:
        raise ValueError(f"noise {kind!r} is not one of {', '.join(NOISES)}")
    if kind == "resonant":
        return _resonant(n, dt, damping, rng)
    if kind == "mix":
        slow, fast = _first_order(1.0, n, dt, rng), _first_order(WHITE_TIME_CONSTANT_S, n, dt, rng)
        return math.sqrt(1.0 - WHITE_SHARE) * slow + math.sqrt(WHITE_SHARE) * fast
    return _first_order(TIME_CONSTANT_S[kind], n, dt, rng)


def _first_order(memory: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    keep = math.exp(-dt / memory)
    shocks = math.sqrt(1.0 - keep * keep) * rng.standard_normal(n)
    shocks[0] /= math.sqrt(1.0 - keep * keep)  # stationary from the first sample on
    out: Array = lfilter([1.0], [1.0, -keep], shocks)
    return out


def _resonant(n: int, dt: float, damping: float, rng: np.random.Generator) -> Array:
    """AR(2) with the poles of an oscillator, brought to unit variance by the variance of an AR(2) process."""
    w = 2.0 * math.pi * RESONANCE_HZ
    r = math.exp(-damping * w * dt)
    a1, a2 = 2.0 * r * math.cos(w * math.sqrt(1.0 - damping**2) * dt), -r * r
    # Box & Jenkins 1976, eq. 3.2.28
    variance = (1.0 - a2) / ((1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1))
    lost = round(20.0 / dt)  # the oscillator forgets within 20 s
    x = lfilter([1.0], [1.0, -a1, -a2], rng.standard_normal(n + lost))
    out: Array = x[lost:] / math.sqrt(variance)
    return out
