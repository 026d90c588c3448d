"""The simulated car: engine lag, drag, rolling resistance; the slope of the road; the gearbox."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.values.types import Array


class Car(NamedTuple):
    """A middle-class car: 100 % pedal gives 4 m/s², 10 % hold 28 m/s.

    The brake is three times as strong as the engine: with less, a linear driver runs into the lead.
    """

    power: float = 0.04  # m/s² per % pedal
    brake: float = 0.12  # m/s² per % below the floor
    lag: float = 0.35  # s, engine and brake
    rolling: float = 0.2  # m/s²
    drag: float = 0.00025  # 1/m, m/s² per (m/s)²

    def hold(self, speed: float) -> float:
        """Return the pedal (%) that holds a speed (m/s) on a level road."""
        return (self.rolling + self.drag * speed * speed) / self.power


GRAVITY = 9.81  # m/s²


def slope_profile(
    n: int,
    dt: float,
    speed: Array,
    sd: float,
    rng: np.random.Generator,
    lengths: tuple[float, float] = (400.0, 3000.0),
) -> Array:
    """Draw the slope under a vehicle that drives at `speed`.

    Args:
        n: number of samples.
        dt: their distance, s.
        speed: (n,) m/s.
        sd: standard deviation of the slope, %.
        rng: source of random numbers.
        lengths: m, of the shortest and the longest hill.

    Returns:
        (n,) %, positive uphill: four waves of hills.
    """
    x = np.cumsum(speed) * dt
    out = np.zeros(n)
    for length in rng.uniform(*lengths, 4):
        out += math.sqrt(2 / 4) * np.sin(2 * math.pi * (x / length + rng.uniform()))
    return sd * out


# m/s; where an automatic gearbox shifts up at light load, and engine revolutions per metre in each gear.
SHIFT_SPEEDS = (4.0, 8.0, 13.0, 19.0, 26.0)
_RPM_PER_SPEED = np.array([400.0, 230.0, 150.0, 112.0, 90.0, 75.0])
_IDLE = 800.0  # rpm


def gearbox(speed: Array) -> tuple[Array, Array]:
    """Return the gear (n,) and the engine speed (n,) rpm at the speeds (n,) m/s."""
    gear = np.searchsorted(SHIFT_SPEEDS, speed, side="right")
    revolutions: Array = np.maximum(_RPM_PER_SPEED[gear] * speed, _IDLE)
    return gear.astype(np.float64) + 1.0, revolutions
