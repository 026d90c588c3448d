"""What the driver does that no model explains: noise of unit variance in six kinds, by recursive filters."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from tests.plants.planted_drive import Array

RESONANCE_HZ = 0.25  # Hz, the bump that spectra of drivers' pedals show
DAMPING = (0.3, 0.5)
WHITE_SHARE = 0.3  # of the variance of "mix"
WARM_UP_S = 60.0  # s that are thrown away: fifteen times the slowest time constant


def unit(kind: str, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw (n,) noise of variance one; "state" is as "ar1": the loop makes it grow with the answer.

    >>> x = unit("resonant", 200_000, 0.02, np.random.default_rng(2))
    >>> bool(abs(x.std() - 1.0) < 0.05)
    True
    """
    damping = rng.uniform(*DAMPING)
    warm = round(WARM_UP_S / dt)
    e, white = rng.standard_normal(n + warm), rng.standard_normal(n)
    if kind == "white":
        return white
    if kind == "resonant":
        return _resonant(e, damping, dt)[warm:]
    slow = _slow(e, 4.0 if kind == "ar4" else 1.0, dt)[warm:]
    if kind == "mix":
        return math.sqrt(1.0 - WHITE_SHARE) * slow + math.sqrt(WHITE_SHARE) * white
    return slow


def _slow(e: Array, tau: float, dt: float) -> Array:
    a = math.exp(-dt / tau)
    x: Array = lfilter([math.sqrt(1.0 - a * a)], [1.0, -a], e)
    return x


def _resonant(e: Array, damping: float, dt: float) -> Array:
    """Second order with its poles where those of the continuous oscillator go at this step."""
    w = 2.0 * math.pi * RESONANCE_HZ
    r = math.exp(-damping * w * dt)
    a1, a2 = 2.0 * r * math.cos(w * math.sqrt(1.0 - damping**2) * dt), -r * r
    # variance of an AR(2), Box, Jenkins & Reinsel 1994, eq. 3.2.28
    variance = (1.0 - a2) / ((1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1))
    x: Array = lfilter([1.0 / math.sqrt(variance)], [1.0, -a1, -a2], e)
    return x
