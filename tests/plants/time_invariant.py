"""Followers whose law never changes (IDM, OVRV, time headway), behind a lead that changes its level of speed.

Written from the equations (Treiber, Hennecke & Helbing 2000; Gunter et al. 2020), without anything of canid's; the
output is the acceleration. What a diagnosis says of them must not depend on the time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.values.types import LearnGate, Trace
from tests.plants.planted_drive import Array

DT = 0.1


class Follower(NamedTuple):
    """Parameters of one follower."""

    law: str  # "idm", "ovrv" or "headway"
    T: float  # s, time headway
    s0: float  # m
    v0: float = 33.0  # m/s; IDM
    a: float = 1.2  # m/s²; IDM
    b: float = 1.8  # m/s²; IDM
    k1: float = 0.03  # 1/s²; OVRV
    k2: float = 0.35  # 1/s; OVRV
    dead_time: float = 0.4  # s

    def accel(self, gap: float, speed: float, range_rate: float) -> float:
        """Return the acceleration, m/s²."""
        if self.law == "ovrv":
            return self.k1 * (gap - self.s0 - self.T * speed) + self.k2 * range_rate
        if self.law == "headway":
            return 20.0 * self.k1 * (gap / max(speed, 1.0) - self.T) + self.k2 * range_rate
        wanted = self.s0 + max(0.0, speed * self.T - speed * range_rate / (2 * math.sqrt(self.a * self.b)))
        return self.a * (1 - (speed / self.v0) ** 4 - (wanted / max(gap, 1.0)) ** 2)


def drawn(law: str, rng: np.random.Generator) -> Follower:
    """Draw a plausible follower."""
    return Follower(
        law, T=rng.uniform(1.0, 1.8), s0=rng.uniform(2.0, 5.0), v0=rng.uniform(30.0, 38.0), a=rng.uniform(0.9, 1.6),
        b=rng.uniform(1.3, 2.2), k1=rng.uniform(0.015, 0.05), k2=rng.uniform(0.25, 0.5), dead_time=rng.uniform(0.3, 0.7),
    )  # fmt: skip


def lead_speed(minutes: float, rng: np.random.Generator, levels: tuple[float, ...] = ()) -> Array:
    """Speed of a lead: levels that change a few times, reached at 1 m/s² at most, with small variations on top."""
    n = round(60 * minutes / DT)
    wanted = np.zeros(n)
    start, level = 0, rng.uniform(12.0, 20.0)
    while start < n:
        stop = start + round(rng.uniform(90.0, 200.0) / DT)
        wanted[start:stop] = level
        start, level = stop, rng.uniform(9.0, 26.0)
    for k, fixed in enumerate(levels):
        wanted[k * n // len(levels) : (k + 1) * n // len(levels)] = fixed
    slow = 0.0
    speed, out = float(wanted[0]), []
    for target, shock in zip(wanted.tolist(), rng.standard_normal(n).tolist(), strict=True):
        slow += DT * (-slow / 8.0) + 0.75 * math.sqrt(2 * DT / 8.0) * shock
        speed += DT * min(max(0.4 * (target + slow - speed), -1.2), 1.0)
        out.append(max(speed, 0.0))
    return np.array(out)


def drive(follower: Follower, lead: Array, rng: np.random.Generator, noise: float = 0.12) -> Trace:
    """Simulate at 10 Hz; the driver's own noise (Ornstein-Uhlenbeck, 1.5 s, `noise` m/s²) is in the loop."""
    n = lead.size
    v, gap, e = float(lead[0]), follower.s0 + 1.1 * follower.T * float(lead[0]), 0.0
    speed, gaps, accel = np.empty(n), np.empty(n), np.empty(n)
    shocks = rng.standard_normal(n).tolist()
    for k in range(n):
        e += DT * (-e / 1.5) + noise * math.sqrt(2 * DT / 1.5) * shocks[k]
        speed[k], gaps[k] = v, gap
        late = max(k - round(follower.dead_time / DT), 0)
        a = follower.accel(float(gaps[late]), float(speed[late]), float(lead[late] - speed[late])) + e
        accel[k] = a
        before = v
        v = max(v + DT * a, 0.0)
        gap = max(gap + DT * (0.5 * (lead[k] + lead[min(k + 1, n - 1)]) - 0.5 * (before + v)), 0.5)
    t = DT * np.arange(n)
    signals = {
        "accel": accel + 0.01 * rng.standard_normal(n),
        "speed": speed + 0.01 * rng.standard_normal(n),
        "gap": gaps + 0.05 * rng.standard_normal(n),
        "range_rate": lead - speed + 0.02 * rng.standard_normal(n),
    }
    inputs = np.stack(
        [signals["gap"] / np.maximum(signals["speed"], 1.0) - 2.0, signals["range_rate"]], axis=1
    )
    gates = tuple(LearnGate.OPEN if v > 2.0 else LearnGate.STANDSTILL for v in speed.tolist())
    return Trace(
        DT, t, signals["accel"], inputs, ("headway_error", "range_rate"), gates, np.ones(n, bool),
        np.zeros(n, np.int64), signals,
    )  # fmt: skip
