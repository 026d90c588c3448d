"""What the driver does not choose: the vehicle ahead, the hills, the wind.

The lead drives with filtered-noise acceleration, follows speed limits that change, and brakes now and then.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from tests.plants.planted_drive import Array


class Traffic(NamedTuple):
    """How the lead of one profile drives."""

    slowest: float  # m/s
    fastest: float  # m/s
    limit: tuple[float, float]  # s between two changes of the speed limit
    unrest: float  # m/s², sd of the acceleration that nobody ordered
    brakes: float  # s between two braking events, on average
    hard: tuple[float, float]  # m/s² of a braking event
    firm: float  # m/s², the most that a new limit makes it accelerate


TRAFFIC = {
    "mixed": Traffic(10.0, 33.0, (15.0, 50.0), 0.35, 45.0, (0.8, 2.2), 1.1),
    "urban": Traffic(3.0, 14.0, (9.0, 28.0), 0.35, 30.0, (0.8, 2.4), 1.2),
    "motorway": Traffic(24.0, 33.0, (30.0, 90.0), 0.22, 60.0, (0.6, 1.5), 0.6),
}


def lead(traffic: Traffic, n: int, dt: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw the speed (n,) m/s and the acceleration (n,) m/s² of the vehicle ahead."""
    seconds = n * dt
    limits, until = [], []
    t = 0.0
    while t <= seconds:
        limits.append(rng.uniform(traffic.slowest + 0.5, traffic.fastest - 0.5))
        t += rng.uniform(*traffic.limit)
        until.append(t)
    pushes = _brake_pulses(traffic, n, dt, rng)
    # noise of the throttle through a power train: two first orders, 1.6 and 0.4 s
    smooth = lfilter([1.0 - math.exp(-dt / 0.4)], [1.0, -math.exp(-dt / 0.4)], _ou(1.6, n, dt, rng))
    # the second filter takes 1 / (1 + 0.4 / 1.6) of the variance
    unrest = (traffic.unrest * math.sqrt(1.25) * smooth).tolist()
    v, a, i = limits[0], 0.0, 0
    speeds, accelerations = [], []
    for k in range(n):
        if k * dt >= until[i]:
            i += 1
        # a limit is approached at firm acceleration from afar and softly at the end
        accel_wanted = traffic.firm * math.tanh(0.3 * (limits[i] - v) / traffic.firm) + unrest[k] + pushes[k]
        # nobody brakes below the slowest or races beyond the fastest
        accel_wanted += 0.8 * (max(traffic.slowest - v, 0.0) - max(v - traffic.fastest, 0.0))
        if v < traffic.slowest and accel_wanted < 0.0:
            accel_wanted = 0.0
        a += (accel_wanted - a) * dt / (0.35 + dt)
        speeds.append(v)
        accelerations.append(a)
        v = max(v + a * dt, 1.5)
    return np.array(speeds), np.array(accelerations)


def _brake_pulses(traffic: Traffic, n: int, dt: float, rng: np.random.Generator) -> list[float]:
    """Acceleration (n,) of braking events: 1 to 3 s long, at the times of a Poisson process."""
    out = np.zeros(n)
    t = rng.exponential(traffic.brakes)
    while t < n * dt:
        length, depth = rng.uniform(1.0, 3.0), rng.uniform(*traffic.hard)
        first, last = round(t / dt), min(round((t + length) / dt), n)
        out[first:last] -= depth
        t += length + rng.exponential(traffic.brakes)
    return out.tolist()


def _ou(memory: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Unit first-order noise."""
    keep = math.exp(-dt / memory)
    shocks = rng.standard_normal(n)
    shocks[1:] *= math.sqrt(1.0 - keep * keep)
    out: Array = lfilter([1.0], [1.0, -keep], shocks)
    return out


# m; the way between two knots of the road's profile
KNOT_SPACING_M = 20.0


def hills(sd: float, way: float, rng: np.random.Generator) -> Array:
    """Draw the slope in % at knots `KNOT_SPACING_M` m apart over `way` m: white noise through a Gaussian of 150 to 400 m."""
    knots = int(way / KNOT_SPACING_M) + 2
    if sd <= 0.0:
        return np.zeros(knots)
    width = rng.uniform(150.0, 400.0) / KNOT_SPACING_M
    reach = math.ceil(4.0 * width)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    x = np.convolve(rng.standard_normal(knots + 2 * reach), bell / math.sqrt(float(bell @ bell)), "valid")
    out: Array = sd * x
    return out


def wind(steady: float, gusts: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw the wind against the car (n,) m/s: steady and gusts of 5 s."""
    return steady + gusts * _ou(5.0, n, dt, rng)


def random_walk(memory: float, sd: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw a slow smooth process (n,) with exactly this sd over the drive: noise through two lags."""
    lost = round(4.0 * memory / dt)
    keep = math.exp(-dt / memory)
    x = lfilter([1.0], [1.0, -2.0 * keep, keep * keep], rng.standard_normal(n + lost))[lost:]
    x = x - x.mean()
    out: Array = sd * x / max(float(x.std()), 1e-12)
    return out
