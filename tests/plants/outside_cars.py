"""Drives of an outside simulator of cars whose answer to the pedal is known; their speed has a sensor's noise and steps.

It imports nothing of canid's simulation: what is estimated must never meet its own formulas. It integrates in steps of
0.01 s, with the driver inside the loop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import canid
from canid.values.types import Trace
from tests.plants.planted_drive import Array

# s; a tenth of the shortest lag that is drawn
STEP = 0.01
# the driver: % per m/s, % per s of headway, s of lag, s of dead time, s of headway that he wants
K_RATE, K_HEADWAY, TAU, THETA, HEADWAY = 6.0, 5.0, 0.4, 0.5, 1.6
# m/s that the lead drives on average
SPEED = 25.0


class Car(NamedTuple):
    """From the pedal to the force."""

    lag: float = 0.0  # s; 0: it answers at once
    strength: float = 0.04  # m/s² per %
    level: float = 12.0  # % that holds `SPEED`
    drag: float = 5e-4  # 1/m; what it leaves of the pull at `level` is rolling
    second_lag: float = 0.0  # s
    low_load_lag: float = 0.0  # s, of a charger that is at half its speed at a pedal of 12 %
    curvature: float = 0.0  # of the pedal's map, about 20 %
    period: float = STEP  # s, after which the engine, and the log, take a new value of the pedal


class Sensors(NamedTuple):
    """How the drive is recorded."""

    rate: float = 20.0  # 1/s
    speed_noise: float = 0.01  # m/s
    speed_step: float = 0.0  # m/s; 0: not rounded
    accel: bool = False  # is the acceleration recorded?


class PedalMotion(NamedTuple):
    """How a driver moves the pedal on the own account."""

    sd: float = 2.0  # %
    correlation: float = 1.0  # s
    rough: bool = True  # False: through a lag of 0.3 s, without a corner


ORDINARY, USUAL_MOTION, FINE = Car(), PedalMotion(), Sensors()


def car_drive(
    seed: int,
    car: Car = ORDINARY,
    motion: PedalMotion = USUAL_MOTION,
    sensors: Sensors = FINE,
    seconds: float = 480.0,
) -> Trace:
    """Follow a lead whose speed varies by 2 m/s.

    Args:
        seed: of lead, driver and sensors.
        car: that is driven.
        motion: of the driver's own.
        sensors: what is recorded of it.
        seconds: of the drive.

    Example:
        >>> trace = car_drive(1, seconds=60.0)
        >>> "accel" in trace.signals, trace.dt
        (False, 0.1)
    """
    rng = np.random.default_rng([seed, 43])
    n = round(seconds / STEP)
    lead = SPEED + _lagged(_autoregression(rng, n, 12.0, 2.0), 1.5)
    own = _autoregression(rng, n, motion.correlation, motion.sd)
    if not motion.rough:
        own = _lagged(own, 0.3)
    rolling = car.strength * car.level - car.drag * SPEED**2
    late, keep = round(THETA / STEP), math.exp(-STEP / TAU)
    rates, headways = np.zeros(n), np.zeros(n)
    v, gap, answer, drive, given = float(lead[0]), HEADWAY * float(lead[0]), 0.0, car.level, car.level
    rows, pedal, every = np.empty((n, 5)), car.level, round(car.period / STEP)
    for k in range(n):
        rates[k], headways[k] = lead[k] - v, gap / max(v, 1.0) - HEADWAY
        then = max(k - late, 0)
        answer = keep * answer + (1.0 - keep) * (K_RATE * rates[then] + K_HEADWAY * headways[then])
        if k % every == 0:
            pedal = min(max(car.level + answer + own[k], 0.0), 100.0)
        pressed = pedal + car.curvature * pedal * (pedal / 20.0 - 1.0)
        drive += _share(car.lag) * (pressed - drive)
        further = car.second_lag + car.low_load_lag / (1.0 + math.exp((drive - 12.0) / 4.0))
        given += _share(further) * (drive - given)
        accel = car.strength * given - rolling - car.drag * v * v
        rows[k] = pedal, v, gap, rates[k], accel
        gap += STEP * rates[k]
        v = max(v + STEP * accel, 0.0)
    pedal_, speed, gap_, rate, accel_ = rows[:: round(1.0 / sensors.rate / STEP)].T
    m = len(speed)
    speed = speed + sensors.speed_noise * rng.standard_normal(m)
    if sensors.speed_step > 0.0:
        speed = sensors.speed_step * np.round(speed / sensors.speed_step)
    recorded = {"accel": accel_ + 0.03 * rng.standard_normal(m)} if sensors.accel else {}
    return canid.from_arrays(
        time=np.arange(m) / sensors.rate,
        pedal=pedal_,
        speed=speed,
        gap=gap_ + 0.05 * rng.standard_normal(m),
        range_rate=rate + 0.03 * rng.standard_normal(m),
        **recorded,
        task="car_following",
        output="pedal",
    )


def _share(lag: float) -> float:
    """Of the way to its input that a lag goes in a step."""
    return 1.0 - math.exp(-STEP / lag) if lag > 0.0 else 1.0


def _autoregression(rng: np.random.Generator, n: int, correlation: float, sd: float) -> Array:
    """(n,) of the first order, correlated over so many s."""
    keep = math.exp(-STEP / correlation)
    shocks = sd * math.sqrt(1.0 - keep * keep) * rng.standard_normal(n)
    shocks[0] = sd * rng.standard_normal()
    return _recursion(shocks, keep)


def _lagged(x: Array, tau: float) -> Array:
    """(n,) through a first-order lag, at rest before."""
    keep = math.exp(-STEP / tau)
    driven = (1.0 - keep) * x
    driven[0] = x[0]
    return _recursion(driven, keep)


def _recursion(x: Array, keep: float) -> Array:
    out, value = np.empty(len(x)), 0.0
    for k, each in enumerate(x.tolist()):
        value = keep * value + each
        out[k] = value
    return out
