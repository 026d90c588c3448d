"""A remnant whose innovations are not evenly Gaussian: jerks of Student's t, bursts, and a size that follows the driving."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from tests.plants.plant_one.remnant import DAMPING, RESONANCE_HZ, WHITE_SHARE
from tests.plants.planted_drive import Array

# s that one jerk lasts: within it all innovations have one size
JERK_S = 0.1
# m/s²: |acceleration| is this on average, and varies by as much; slopes are per this
USUAL_ACCEL = 0.3
# deviations that count; beyond them a slope goes on no more
MOST = 3.0
# s between bursts, on average
CALM_S = 12.0
# effect -> what makes the remnant uneven
UNEVEN = ("heavy_tails", "state_dependent_scale", "clustered_scale")

Stepwise = Callable[
    [float, float], float
]  # own and lead's acceleration, m/s² -> remnant of about unit variance


def stepwise(
    kind: str, n: int, dt: float, has: Mapping[str, Mapping[str, float]], rng: np.random.Generator
) -> Stepwise:
    """Prepare the remnant of one drive, to be asked for step by step.

    >>> jerky = stepwise("ar1", 30000, 0.02, {"heavy_tails": {"freedom": 3.0}}, np.random.default_rng(1))
    >>> x = np.diff([jerky(0.0, 0.0) for _ in range(30000)])
    >>> bool(np.mean(x**4) > 5.0 * np.mean(x**2) ** 2)
    True
    """
    damping = rng.uniform(*DAMPING)
    shock, white = rng.standard_normal(n), rng.standard_normal(n)
    size = np.ones(n)
    if "heavy_tails" in has:
        size *= _jerks(has["heavy_tails"]["freedom"], n, dt, rng)
    if "clustered_scale" in has:
        size *= _bursts(has["clustered_scale"], n, dt, rng)
    follows = has.get("state_dependent_scale", {"own": 0.0, "lead": 0.0})
    shocks, whites = (size * shock).tolist(), (size * white).tolist()
    filtered = _filter(kind, dt, damping)
    k = -1

    def step(own: float, lead: float) -> float:
        nonlocal k
        k += 1
        grown = math.exp(follows["own"] * _beyond(own) + follows["lead"] * _beyond(lead))
        return filtered(grown * shocks[k], grown * whites[k])

    return step


def _beyond(accel: float) -> float:
    return min(abs(accel) / USUAL_ACCEL - 1.0, MOST)


def _jerks(freedom: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Sizes (n,) that make normal shocks Student's t, jerk by jerk."""
    each = round(JERK_S / dt)
    size = np.sqrt(freedom / rng.chisquare(freedom, n // each + 1)) * math.sqrt((freedom - 2.0) / freedom)
    return np.repeat(size, each)[:n]


def _bursts(how: Mapping[str, float], n: int, dt: float, rng: np.random.Generator) -> Array:
    """Sizes (n,): `ratio` times as large in bursts as between them."""
    size = np.ones(n)
    t = rng.exponential(CALM_S)
    while t < n * dt:
        stop = t + rng.exponential(how["duration"])
        size[round(t / dt) : round(stop / dt)] = how["ratio"]
        t = stop + rng.exponential(CALM_S)
    return size / math.sqrt(float(np.mean(size * size)))


def _filter(kind: str, dt: float, damping: float) -> Callable[[float, float], float]:
    if kind == "white":
        return lambda shock, white: white
    x1 = x2 = 0.0
    if kind == "resonant":
        w = 2.0 * math.pi * RESONANCE_HZ
        r = math.exp(-damping * w * dt)
        a1, a2 = 2.0 * r * math.cos(w * math.sqrt(1.0 - damping**2) * dt), -r * r
        gain = math.sqrt((1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1) / (1.0 - a2))
    else:
        a1, a2 = math.exp(-dt / (4.0 if kind == "ar4" else 1.0)), 0.0
        gain = math.sqrt(1.0 - a1 * a1)
    slow, fast = (math.sqrt(1.0 - WHITE_SHARE), math.sqrt(WHITE_SHARE)) if kind == "mix" else (1.0, 0.0)

    def filtered(shock: float, white: float) -> float:
        nonlocal x1, x2
        x1, x2 = a1 * x1 + a2 * x2 + gain * shock, x1
        return slow * x1 + fast * white

    return filtered
