"""Noise that comes unevenly: t-distributed pushes, an intensity that drifts, a scale that follows accelerations."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from tests.plants.plant_two.remnant import RESONANCE_HZ, TIME_CONSTANT_S, WHITE_SHARE, WHITE_TIME_CONSTANT_S
from tests.plants.planted_drive import Array

PUSH_S = 0.2  # s; a push's strength holds so long
INTENSITY_S = 5.0  # s; time constant of the intensity's logarithm
# m/s²: mean and standard deviation of |acceleration| in ordinary traffic, and the most that counts of it
ACCEL_MEAN, ACCEL_SD, ACCEL_MOST = 0.3, 0.3, 1.2
BURSTY = ("heavy_tails", "state_dependent_scale", "clustered_scale")


class BurstRemnant:
    """The remnant of a drive, one sample after another."""

    def __init__(
        self,
        kind: str,
        n: int,
        dt: float,
        damping: float,
        values: Mapping[str, Mapping[str, float]],
        rng: np.random.Generator,
    ) -> None:
        """Draw what does not depend on the drive.

        >>> own = BurstRemnant("ar1", 6000, 0.01, 0.4, {"clustered_scale": {"sd": 0.6}}, np.random.default_rng(4))
        >>> len([own.next(0.3, 0.3) for _ in range(6000)])
        6000
        """
        size = np.ones(n)
        if "heavy_tails" in values:
            size *= pushes(values["heavy_tails"]["freedom"], n, round(PUSH_S / dt), rng)
        if "clustered_scale" in values:
            size *= intensity(values["clustered_scale"]["sd"], n, dt, rng)
        slopes = values.get("state_dependent_scale", {})
        self.own, self.lead = slopes.get("own", 0.0), slopes.get("lead", 0.0)
        self.shocks = (size * rng.standard_normal(n)).tolist()
        self.fast = (size * rng.standard_normal(n)).tolist()
        self.k = 0
        self.x = [0.0, 0.0]
        self.y = 0.0
        self.white_share = WHITE_SHARE if kind == "mix" else 0.0
        self.keep_fast = math.exp(-dt / WHITE_TIME_CONSTANT_S)
        if kind == "resonant":
            w = 2.0 * math.pi * RESONANCE_HZ
            r = math.exp(-damping * w * dt)
            self.a = (2.0 * r * math.cos(w * math.sqrt(1.0 - damping**2) * dt), -r * r)
        else:
            self.a = (math.exp(-dt / TIME_CONSTANT_S.get(kind, 1.0)), 0.0)
        a1, a2 = self.a
        self.gain = math.sqrt((1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1) / (1.0 - a2))

    def next(self, own_accel: float, lead_accel: float) -> float:
        """Noise of about unit variance at the next sample."""
        log = self.own * _deviation(own_accel) + self.lead * _deviation(lead_accel)
        grown, k = math.exp(log), self.k
        self.k += 1
        now = self.a[0] * self.x[0] + self.a[1] * self.x[1] + self.gain * grown * self.shocks[k]
        self.x = [now, self.x[0]]
        if not self.white_share:
            return now
        self.y = self.keep_fast * self.y + math.sqrt(1.0 - self.keep_fast**2) * grown * self.fast[k]
        return math.sqrt(1.0 - self.white_share) * now + math.sqrt(self.white_share) * self.y


def _deviation(accel: float) -> float:
    return (min(abs(accel), ACCEL_MOST) - ACCEL_MEAN) / ACCEL_SD


def pushes(freedom: float, n: int, each: int, rng: np.random.Generator) -> Array:
    """Sizes (n,) from an inverse gamma, so that pushes are t-distributed with unit variance."""
    precision = rng.gamma(0.5 * freedom, 2.0 / (freedom - 2.0), n // each + 1)
    return np.repeat(1.0 / np.sqrt(precision), each)[:n]


def intensity(sd: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    """Sizes (n,) whose logarithm is autocorrelated (stochastic volatility: Taylor 1986), mean square one."""
    keep = math.exp(-dt / INTENSITY_S)
    shocks = math.sqrt(1.0 - keep * keep) * rng.standard_normal(n)
    shocks[0] /= math.sqrt(1.0 - keep * keep)
    size = np.exp(sd * lfilter([1.0], [1.0, -keep], shocks))
    return np.asarray(size / math.sqrt(float(np.mean(size * size))))
