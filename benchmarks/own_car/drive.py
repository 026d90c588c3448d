"""A simulator of car following that shares no code with canid's: gear box, hills, cut-ins, a late radar.

The driver presses the pedal by K for each m/s of range rate and for each s of headway error, behind a lag and a dead time;
the car is a force by gear, drag, rolling resistance and slope.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# s
STEP_S = 0.01
# the driver's truth: %/(m/s), %/s, s, s
RANGE_RATE_K, HEADWAY_K, TAU_S, DEAD_TIME_S = 6.0, 4.0, 0.45, 0.5
HEADWAY_DESIRED_S = 1.8
# acceleration by pedal and gear, m/s² for each %
_PUSH = (0.085, 0.07, 0.058, 0.05, 0.045, 0.042)
# m/s at which the gears change up
_SHIFTS = (5.0, 9.0, 13.0, 18.0, 23.0)
# rpm for each m/s, by gear
_RPM = (300.0, 190.0, 130.0, 100.0, 80.0, 66.0)


class Drive(NamedTuple):
    """Columns of a drive every `STEP_S`."""

    t: Array  # s
    pedal: Array  # %
    speed: Array  # m/s
    gap: Array  # m
    range_rate: Array  # m/s
    lead: npt.NDArray[np.int64]  # number of the vehicle ahead: a cut-in is another one
    brake: Array  # 0 or 1
    rpm: Array
    latency: float  # s, of the radar's reports


def drive(seconds: float, seed: int) -> Drive:
    """Simulate a drive behind a vehicle whose speed varies."""
    rng = np.random.default_rng(seed)
    n = round(seconds / STEP_S)
    lead_speed = _lead_speed(n, rng)
    knots = np.arange(0.0, seconds + 20.0, 20.0)
    slope = np.interp(np.arange(n) * STEP_S, knots, rng.normal(0, 0.15, len(knots)))
    cut_ins = set((rng.uniform(0.2, 0.9, 3) * n).astype(int).tolist())
    noise = _noise(n, rng)
    delay, decay = round(DEAD_TIME_S / STEP_S), np.exp(-STEP_S / TAU_S)
    names = ("pedal", "speed", "gap", "range_rate", "brake", "rpm")
    columns = {name: np.zeros(n) for name in names}
    lead = np.zeros(n, np.int64)
    v, gap, answer, asked, number = float(lead_speed[0]), 1.8 * float(lead_speed[0]), 0.0, np.zeros(n), 0
    trim = 25.0
    for k in range(n):
        if k in cut_ins and gap > 25.0:
            gap *= rng.uniform(0.55, 0.8)
            number += 1
        rate = lead_speed[k] - v
        asked[k] = RANGE_RATE_K * rate + HEADWAY_K * (gap / max(v, 3.0) - HEADWAY_DESIRED_S)
        answer = decay * answer + (1 - decay) * asked[max(k - delay, 0)]
        demand = trim + answer + noise[k]
        pedal = min(max(demand, 0.0), 100.0)
        gear = sum(v > limit for limit in _SHIFTS)
        accel = _PUSH[gear] * (pedal - trim) - 0.02 * (v - 21.0) - slope[k] - 0.05 * max(-demand, 0.0)
        row = (pedal, v, gap, rate, float(demand < -3.0), 800.0 + _RPM[gear] * v)
        for name, value in zip(names, row, strict=True):
            columns[name][k] = value
        lead[k] = number
        gap = max(gap + STEP_S * rate, 3.0)
        v = max(v + STEP_S * accel, 0.0)
    t = np.arange(n) * STEP_S
    return Drive(t, lead=lead, latency=float(rng.uniform(0.05, 0.15)), **columns)


def _lead_speed(n: int, rng: np.random.Generator) -> Array:
    """Speed of the traffic: targets that change every 6 to 20 s, reached with 0.3 to 1.2 m/s²."""
    out, speed, target, accel, until = np.zeros(n), 22.0, 22.0, 0.6, 0
    for k in range(n):
        if k >= until:
            target, accel = rng.uniform(14.0, 28.0), rng.uniform(0.3, 1.2)
            until = k + round(rng.uniform(6.0, 20.0) / STEP_S)
        speed += float(np.clip(target - speed, -accel * STEP_S, accel * STEP_S))
        out[k] = speed
    width = round(0.8 / STEP_S)
    return np.convolve(np.pad(out, width, mode="edge"), np.ones(width) / width, "same")[width:-width]


def _noise(n: int, rng: np.random.Generator) -> Array:
    """The driver's remnant: autoregressive, 1.5 % and 1.5 s."""
    decay = np.exp(-STEP_S / 1.5)
    white = rng.standard_normal(n) * 1.5 * np.sqrt(1 - decay**2)
    out = np.zeros(n)
    for k in range(1, n):
        out[k] = decay * out[k - 1] + white[k]
    return out
