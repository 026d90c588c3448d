"""A textbook IDM behind a lead, written here on its own: plain steps of 0.02 s, with noise of driver and sensors."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid import from_arrays
from canid.values.types import Array, Trace

DT, EVERY = 0.02, 5


class Planted(NamedTuple):
    v0: float = 36.0  # m/s
    T: float = 1.4  # s
    s0: float = 2.5  # m
    a: float = 1.3  # m/s²
    b: float = 1.8  # m/s²
    sd: float = 0.0  # m/s², of an Ornstein-Uhlenbeck error
    time: float = 2.0  # s


class Driven(NamedTuple):
    trace: Trace
    gap: Array  # without sensor noise, on the trace's grid
    speed: Array
    accel: Array


def drawn(seed: int, **fixed: float) -> Planted:
    """Parameters of ordinary drivers."""
    rng = np.random.default_rng([seed, 7])
    u = rng.uniform
    of = Planted(u(32, 45), u(0.9, 2.0), u(1.5, 4.0), u(0.8, 2.0), u(1.2, 3.0))
    return of._replace(**fixed)


def driven(of: Planted, seed: int, minutes: float = 8.0) -> Driven:
    """Drive behind a lead between standstill and 25 m/s; the radar's noise is 0.1 m and 0.05 m/s."""
    rng = np.random.default_rng([seed, 8])
    n = round(60 * minutes / DT)
    lead = lead_speed(n, rng)
    gap, speed, error = of.s0 + of.T * lead[0] + 2.0, float(lead[0]), 0.0
    keep = math.exp(-DT / of.time)
    rows = np.empty((n, 3))
    for k, u in enumerate(lead.tolist()):
        wanted = of.s0 + max(0.0, speed * of.T + speed * (speed - u) / (2 * math.sqrt(of.a * of.b)))
        error = keep * error + of.sd * math.sqrt(1 - keep * keep) * float(rng.standard_normal())
        accel = of.a * (1 - (speed / of.v0) ** 4 - (wanted / max(gap, 0.1)) ** 2) + error
        new = max(speed + DT * accel, 0.0)
        rows[k] = gap, speed, (new - speed) / DT
        gap += DT * (u - 0.5 * (speed + new))
        speed = new
    gaps, speeds, accels = rows[::EVERY].T
    u = lead[::EVERY]
    t = DT * EVERY * np.arange(u.size)
    trace = from_arrays(
        time=t,
        accel=accels,
        speed=speeds + 0.02 * rng.standard_normal(u.size),
        gap=gaps + 0.1 * rng.standard_normal(u.size),
        range_rate=u - speeds + 0.05 * rng.standard_normal(u.size),
        output="accel",
    )
    return Driven(trace, gaps, speeds, accels)


def lead_speed(n: int, rng: np.random.Generator) -> Array:
    """Levels of 5 to 30 s that are approached with at most 1.5 m/s²; every eighth is a standstill."""
    levels: list[float] = []
    while len(levels) < n:
        level = 0.0 if rng.random() < 1 / 8 else float(rng.uniform(4.0, 25.0))
        levels += [level] * round(rng.uniform(5.0, 30.0) / DT)
    speed, out = 15.0, np.empty(n)
    for k in range(n):
        speed += min(max(levels[k] - speed, -1.5 * DT), 1.0 * DT)
        out[k] = speed
    return out
