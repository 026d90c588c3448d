"""The vehicle ahead: legs of constant acceleration between random speeds, and a throttle that is never still."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from tests.plants.planted_drive import Array


class Road(NamedTuple):
    """How people drive on one kind of road."""

    low: float  # m/s; a leg ends between low and high
    high: float
    cruise: tuple[float, float]  # s at one speed between two legs
    push: tuple[float, float]  # m/s² of a leg upwards
    brake: tuple[float, float]  # m/s² of a leg downwards
    unrest: float  # m/s; sd of the speed about its legs


# Everyday accelerations, some 1 m/s² in town and half of it on motorways (Hoberock 1977; naturalistic studies agree)
ROADS = {
    "mixed": Road(11.0, 32.0, (4.0, 22.0), (0.3, 1.0), (0.3, 1.2), 0.7),
    "urban": Road(4.5, 13.5, (3.0, 14.0), (0.4, 1.2), (0.5, 1.4), 0.5),
    "motorway": Road(25.0, 32.0, (8.0, 35.0), (0.2, 0.7), (0.2, 1.0), 0.7),
}
SMOOTHING_S = 0.7  # s; nobody's acceleration jumps
UNREST_LAG_S = 1.5  # s; of each of two lags in a row: speed varies at about 0.1 Hz, as that of measured leads
MIN_SPEED_M_S = 3.0  # m/s; walking pace is no car following


def speed(profile: str, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Draw the lead's speed (n,) m/s at steps of dt s.

    >>> v = speed("urban", 30_000, 0.02, np.random.default_rng(1))
    >>> bool(v.min() >= 3.0 and v.max() < 18.0)
    True
    """
    road = ROADS[profile]
    t, v = [0.0], [float(rng.uniform(road.low, road.high))]
    while t[-1] < n * dt:
        t.append(t[-1] + rng.uniform(*road.cruise))
        v.append(v[-1])
        aim = float(rng.uniform(road.low, road.high))
        t.append(t[-1] + abs(aim - v[-1]) / rng.uniform(*(road.push if aim > v[-1] else road.brake)))
        v.append(aim)
    legs = _lag(np.interp(np.arange(n) * dt, t, v), SMOOTHING_S, dt)
    # two lags in a row leave a quarter of the variance rate of one: sd of white noise through them is sqrt(dt / 4T)
    calm = round(10 * UNREST_LAG_S / dt)
    noise = _lag(_lag(rng.standard_normal(n + calm), UNREST_LAG_S, dt), UNREST_LAG_S, dt)[calm:]
    return np.maximum(legs + road.unrest * noise / (dt / (4.0 * UNREST_LAG_S)) ** 0.5, MIN_SPEED_M_S)


def _lag(x: Array, tau: float, dt: float) -> Array:
    a = np.exp(-dt / tau)
    y: Array = lfilter([1.0 - a], [1.0, -a], x - x[0]) + x[0]
    return y
