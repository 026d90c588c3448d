"""Noise models of the driver (white, AR(1), resonant, state-dependent), each with unit variance."""

from __future__ import annotations

import math

import numpy as np

from canid.values.types import Array

NOISES = ("white", "ar1", "ar4", "resonant", "state", "mix", "none")

RESONANCE_HZ = 0.25  # the bump that pedal spectra of drivers show, with a damping of 0.4
DAMPING = 0.4
WHITE_SHARE = 0.3  # of the variance of "mix"


def unit_noise(kind: str, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw driver noise with variance 1.

    Args:
        kind: "white"; "ar1" and "ar4": first order with a time constant of 1 s and 4 s; "resonant": second
            order at 0.25 Hz; "state": as ar1, and the loop makes it grow with the driver's answer; "mix":
            ar1 and 30 % white; "none".
        n: number of samples.
        dt: their distance, s.
        rng: source of random numbers.

    Returns:
        (n,) dimensionless.

    Raises:
        ValueError: unknown kind.

    Example:
        >>> x = unit_noise("ar1", 100_000, 0.01, np.random.default_rng(1))
        >>> bool(abs(x.std() - 1) < 0.1), round(float(np.corrcoef(x[:-100], x[100:])[0, 1]), 1)
        (True, 0.4)
    """
    if kind not in NOISES:
        raise ValueError(f"noise kind {kind!r} is not one of {', '.join(NOISES)}")
    if kind == "none":
        return np.zeros(n)
    if kind == "white":
        return rng.standard_normal(n)
    if kind == "resonant":
        return _second_order(n, dt, rng)
    slow = first_order(4.0 if kind == "ar4" else 1.0, n, dt, rng)
    if kind == "mix":
        return math.sqrt(1 - WHITE_SHARE) * slow + math.sqrt(WHITE_SHARE) * rng.standard_normal(n)
    return slow


def first_order(time_constant: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw an Ornstein–Uhlenbeck process, sampled exactly, stationary from the first sample on."""
    a = math.exp(-dt / time_constant)
    x = float(rng.standard_normal())
    shocks = (math.sqrt(1 - a * a) * rng.standard_normal(n)).tolist()
    out = np.empty(n)
    for k, shock in enumerate(shocks):
        out[k] = x
        x = a * x + shock
    return out


def _second_order(n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw an oscillator driven by white noise; its two states start stationary."""
    w, z = 2 * math.pi * RESONANCE_HZ, DAMPING
    # Stationary: var x = 1 and var x' = w² for x'' + 2zw x' + w² x = sqrt(4 z w³) e.
    x, rate = float(rng.standard_normal()), w * float(rng.standard_normal())
    shocks = (math.sqrt(4 * z * w**3 * dt) * rng.standard_normal(n)).tolist()
    out = np.empty(n)
    for k, shock in enumerate(shocks):
        out[k] = x
        rate += (-2 * z * w * rate - w * w * x) * dt + shock
        x += rate * dt  # with the new rate: keeps the energy at w dt = 0.016
    return out
