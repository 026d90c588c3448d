"""What a driver adds to a car-following model: an Ornstein-Uhlenbeck process whose effect in the loop is that of the drive.

Gap, speed and acceleration were driven otherwise than the model does; size and correlation time are such that the model with
the noise deviates from the one without by as much, in mean square (estimation by simulation, McFadden 1989). The
residual of the acceleration at the measured state would not do: where the model is wrong it is correlated with that state,
and as noise it would move the car by several times of what was driven.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.models.diagnosis.rivals.rival_model import RivalModel
from canid.models.diagnosis.rivals.rival_simulation import Leads, simulate
from canid.values.types import NAN, Array, Interval

# s; correlation times that are tried, and replicates of each: the mean squares are then known to some per cent
TIMES = np.geomspace(0.3, 12.0, 8)
REPLICATES = 3
# m/s²; of the first replicates. The loop is not quite linear: a second pass begins with what the first one found
FIRST_SD, PASSES = 0.3, 2
# s; of the acceleration: the sensor's noise is then small against what was driven
ACCEL_S = 1.0
# m², (m/s)², (m/s²)²; deviations below resolutions of sensors are none
SMALLEST = np.array([1e-4, 1e-6, 1e-6])


class DriverNoise(NamedTuple):
    """An Ornstein-Uhlenbeck process."""

    sd: Interval = Interval()  # m/s² of an acceleration, m/s of a speed
    time: Interval = Interval()  # s, correlation time
    # what `sd` is divided by: m/s² or m/s per relative error of the gap, or per (m/s)/m of the range rate
    sensitivity: float = NAN


def noise(model: RivalModel, q: Array, stretches: Leads, scale: float = 1.0) -> tuple[Interval, Interval]:
    """Standard deviation and correlation time.

    Args:
        model: which one.
        q: (k,) its parameters.
        stretches: the stretches.
        scale: m/s² of acceleration per unit of the process.

    Returns:
        intervals of 95 % by the jackknife over the stretches, of the logarithms; sd 0: the drive does not deviate.
    """
    gap, speed = (x[:, 0] for x in simulate(model, q[:, None], stretches))
    measured = _squares(
        stretches.gap[:, None] - gap[:, None], stretches.speed[:, None] - speed[:, None], stretches
    )[:, 0]  # (3, m)
    if not np.all(measured.sum(axis=1) / stretches.inside.sum() > SMALLEST):
        return Interval(0.0, 0.0, NAN), Interval()
    m = stretches.inside.shape[1]
    # all stretches, then each left out
    weight = np.concatenate([np.ones((m, 1)), 1.0 - np.eye(m)], axis=1)
    wanted = np.log(np.maximum(measured @ weight, np.finfo(float).tiny))  # (3, 1 + m)
    sd = np.full(TIMES.size, FIRST_SD / scale)
    for _ in range(PASSES):
        drawn = _process(sd, stretches)
        moved = simulate(model, np.repeat(q[:, None], drawn.shape[1], axis=1), stretches, scale * drawn)
        squares = _squares(moved[0] - gap[:, None], moved[1] - speed[:, None], stretches)
        squares = squares.reshape(3, TIMES.size, REPLICATES, m).mean(axis=2)
        simulated = np.log(np.maximum(squares @ weight, np.finfo(float).tiny))  # (3, times, 1 + m)
        left = wanted[:, None] - simulated
        log_sd = np.log(sd)[:, None] + 0.5 * left.mean(axis=0)  # (times, 1 + m)
        sd = np.exp(log_sd[:, 0])
    place = _lowest(left.var(axis=0))
    at = np.arange(TIMES.size, dtype=float)
    # between the times that were tried
    size = np.array([np.interp(x, at, column) for x, column in zip(place, log_sd.T, strict=True)])
    return _spread(size), _spread(np.interp(place, at, np.log(TIMES)))


def _lowest(error: Array) -> Array:
    """Place of each column's lowest value between the rows, by a parabola through its neighbours; error (times, k)."""
    k = np.clip(np.argmin(error, axis=0), 1, len(error) - 2)
    columns = np.arange(error.shape[1])
    before, here, after = (error[k + step, columns] for step in (-1, 0, 1))
    bend = before - 2 * here + after
    moved = np.where(
        bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), np.sign(before - after)
    )
    out: Array = k + np.clip(moved, -1.0, 1.0)
    return out


def _process(sd: Array, stretches: Leads) -> Array:
    """Draw, (steps - 1, times * replicates, m); the same drive gives the same numbers."""
    rng = np.random.default_rng(0)
    steps, m = stretches.inside.shape
    white = rng.standard_normal((steps - 1, REPLICATES, m))
    keep = np.exp(-stretches.dt / TIMES)[:, None, None]
    out = np.empty((steps - 1, TIMES.size, REPLICATES, m))
    out[0] = white[0]
    for k in range(1, steps - 1):
        out[k] = keep * out[k - 1] + np.sqrt(1.0 - keep**2) * white[k]
    return (out * sd[:, None, None]).reshape(steps - 1, -1, m)


def _squares(gap: Array, speed: Array, stretches: Leads) -> Array:
    """Sums of squares of deviations of gap, speed and acceleration, (3, p, m); arguments (steps, p, m)."""
    k = max(round(ACCEL_S / stretches.dt), 1)
    inside = stretches.inside[:, None]
    accel = np.where(inside[k:], (speed[k:] - speed[:-k]) / (k * stretches.dt), 0.0)
    return np.array(
        [np.sum(np.where(inside, x, 0.0) ** 2, axis=0) for x in (gap, speed)] + [np.sum(accel**2, axis=0)]
    )


def _spread(log: Array) -> Interval:
    m = log.size - 1
    sd = np.sqrt((m - 1) / m * np.sum((log[1:] - np.mean(log[1:])) ** 2))
    value = float(log[0])
    return Interval(*(float(np.exp(value + k * NORMAL_QUANTILE * sd)) for k in (0, -1, 1)))
