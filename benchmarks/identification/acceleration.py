"""A driver who answers with an acceleration, in closed loop behind a lead, and what is published of such a drive.

Written apart from canid's own simulation. The accelerations of public data are derived from measured speeds, most often
by a centred filter; the speeds are known to some millimetres per second (GNSS) to some centimetres per second (CAN).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter, savgol_filter

from benchmarks.identification.bounds import Lag
from benchmarks.identification.loops import Gain, constant
from benchmarks.identification.noise_models import NoiseModel, draw

DT = 0.1  # s, of what is published
FINE = 0.02  # s, of the loop
HEADWAY = 1.6  # s that the driver wants
REMNANT = 0.25  # m/s², sd of what the driver adds
# sd of what a good radar publishes
HEADWAY_NOISE, RANGE_RATE_NOISE = 0.01, 0.05  # s, m/s


class Drive(NamedTuple):
    """Truth and inputs of one drive."""

    acceleration: np.ndarray  # (n,) m/s², as it was
    speed: np.ndarray  # (n,) m/s, as it was
    inputs: np.ndarray  # (n, 2) headway error and range rate, measured
    channels: tuple[Lag, Lag]


class Measured(NamedTuple):
    """How the acceleration came about."""

    name: str
    kind: str  # of filter
    width: float  # s
    speed_noise: float  # m/s


def drive(seed: int, minutes: float, noise: NoiseModel, sensor: float = 1.0, gain: Gain = constant) -> Drive:
    """Simulate a drive; driver, lead and noise are drawn.

    Args:
        seed: of the run.
        minutes: how long.
        noise: of the driver.
        sensor: times the usual sensor noise.
        gain: factor on both gains over the drive.
    """
    rng = np.random.default_rng(seed)
    n = int(minutes * 60 / FINE)
    gains = rng.uniform(0.15, 0.5), rng.uniform(0.4, 0.9)
    tau, dead_time = rng.uniform(0.25, 0.7, 2), rng.uniform(0.2, 0.6, 2)
    lead = lead_speed(rng, n)
    remnant = REMNANT * draw(noise, n, FINE, rng)
    late = np.round(dead_time / FINE).astype(int)
    decay = np.exp(-FINE / tau)
    factor = gain(np.arange(n) * FINE).tolist()
    state, speed, gap = [0.0, 0.0], lead[0], HEADWAY * lead[0]
    seen = np.zeros((2, n))
    out = np.empty((2, n))
    for i in range(n):
        seen[:, i] = gap / speed - HEADWAY, lead[i] - speed
        for k in range(2):
            u = seen[k, i - late[k]] if i >= late[k] else 0.0
            state[k] = decay[k] * state[k] + (1.0 - decay[k]) * u
        answer = factor[i] * (gains[0] * state[0] + gains[1] * state[1])
        a = min(max(answer + remnant[i], -6.0), 4.0)
        out[:, i] = a, speed
        gap = max(gap + FINE * (lead[i] - speed), 2.0)
        speed = max(speed + FINE * a, 3.0)
    pick = slice(None, None, round(DT / FINE))
    inputs = seen[:, pick].T
    inputs = inputs + rng.normal(size=inputs.shape) * (sensor * HEADWAY_NOISE, sensor * RANGE_RATE_NOISE)
    channels = tuple(Lag(K, float(t), float(d)) for K, t, d in zip(gains, tau, late * FINE, strict=True))
    return Drive(out[0, pick], out[1, pick], inputs, channels)  # type: ignore[arg-type]


def lead_speed(rng: np.random.Generator, n: int) -> np.ndarray:
    """A lead that takes another speed every 20 s, and sways."""
    wanted = np.repeat(rng.uniform(12.0, 30.0, n // round(20.0 / FINE) + 2), round(20.0 / FINE))[:n]
    sway = 0.25 * math.sqrt(FINE) * rng.normal(size=n)
    speed, a = np.empty(n), 0.0
    v = wanted[0]
    for i in range(n):
        a += FINE * (min(max(0.25 * (wanted[i] - v), -1.5), 1.2) - a) + sway[i]
        v = max(v + FINE * a, 5.0)
        speed[i] = v
    return speed


def published(of: Drive, how: Measured, seed: int) -> np.ndarray:
    """Return (n,) the acceleration as it was published."""
    rng = np.random.default_rng((seed, 1))
    speed = of.speed + how.speed_noise * rng.normal(size=len(of.speed))
    raw = np.diff(speed, append=speed[-1]) / DT
    taps = round(how.width / DT)
    if how.kind == "savitzky_golay":
        return np.asarray(savgol_filter(speed, taps, 2, deriv=1, delta=DT))
    if how.kind == "moving_average":
        # between two speeds the mean acceleration is half a sample late
        return np.convolve(raw, np.convolve(np.ones(taps) / taps, [0.5, 0.5]))[taps // 2 :][: len(raw)]
    if how.kind == "first_order":
        decay = math.exp(-DT / how.width)
        centred = np.convolve(raw, [0.5, 0.5])[: len(raw)]
        return np.asarray(lfilter([1.0 - decay], [1.0, -decay], centred))
    return of.acceleration + how.speed_noise * rng.normal(size=len(of.speed))
