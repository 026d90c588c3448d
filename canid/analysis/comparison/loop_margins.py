"""Margins and string stability of each drive's driver with its car, at one speed and headway for all of them.

The margins of `identify` belong to the speed and headway of their own drive, which differ; the posterior's draws give them
anew where all drives can be compared. Drives in one vehicle share one car: what its estimates differ by is not the drivers'.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.comparison.drive import DriveEstimates, Loop
from canid.mathematics.identification.confidence import QUANTILES, TAIL
from canid.mathematics.systems import following_loop
from canid.mathematics.systems.following_loop import FollowingLoop
from canid.values.types import Array, Interval

# name, field of LoopMargins, unit
MARGINS = (
    ("phase_margin", "phase_margin_deg", "°"),
    ("delay_margin", "delay_margin_s", "s"),
    ("string_peak", "string_peak", ""),
)
# share of unstable draws from which on a margin has no interval
MAX_UNSTABLE = TAIL
# a car is drawn no weaker than this share of its estimate, as in mathematics/systems/posterior_draws.py
MIN_STRENGTH_SHARE = 0.1


class Car(NamedTuple):
    """A car at a speed."""

    value: Array  # (3,) strength, lag, damping
    covariance: Array  # (3, 3)


class Point(NamedTuple):
    """Where all loops are linearised."""

    speed: float  # m/s
    headway: float  # s
    # of all drives in one vehicle, so that its errors are not the drivers'; None: each drive's own
    car: Car | None = None


def common_point(drives: Sequence[DriveEstimates]) -> Point | None:
    """Mean of the drives' medians, and the car where all drives are in one vehicle; None: no drive has a loop."""
    known = [drive for drive in drives if drive.loop is not None and drive.draws is not None]
    loops = [drive.loop for drive in known if drive.loop is not None]
    if not loops:
        return None
    at = Point(
        float(np.mean([loop.speed for loop in loops])), float(np.mean([loop.headway for loop in loops]))
    )
    cars = [_car(loop, at.speed) for loop in loops]
    if len({drive.vehicle for drive in known}) > 1:
        return at
    several = [car for car in cars if car is not None]
    return at._replace(car=_mean(several)) if len(several) == len(cars) else at


def margins(drive: DriveEstimates, at: Point) -> dict[str, Array]:
    """Draws (n,) of each of `MARGINS`; none where the drive has no loop, or its draws are unstable."""
    if drive.loop is None or drive.draws is None:
        return {}
    drawn = drive.draws
    loop = FollowingLoop(drawn.K, drawn.tau, drawn.dead_time, at.speed, at.headway)
    car = _car(drive.loop, at.speed)
    if at.car is not None:
        strength, lag, damping = at.car.value[:, None]
        loop = loop._replace(strength=strength, lag=lag, damping=damping)
    elif car is not None:
        strength, lag, damping = _drawn(car, len(drawn.K))
        loop = loop._replace(strength=strength, lag=lag, damping=damping)
    drawn_margins = following_loop.margins(loop)
    if float(drawn_margins.unstable.mean()) > MAX_UNSTABLE:
        return {}
    return {name: getattr(drawn_margins, field) for name, field, _ in MARGINS}


def interval(draws: Array) -> Interval:
    """Median and 95 % interval."""
    low, middle, high = np.quantile(draws, (QUANTILES[0], 0.5, QUANTILES[1]), method="nearest")
    return Interval(float(middle), float(low), float(high))


def _car(loop: Loop, speed: float) -> Car | None:
    """A drive's car at another speed: the damping by drag, which grows with the square of the speed, is in proportion."""
    if loop.car is None:
        return None
    scale = np.array([1.0, 1.0, speed / loop.speed])
    return Car(np.array(loop.car) * scale, loop.covariance * np.outer(scale, scale))


def _mean(cars: Sequence[Car]) -> Car:
    """Mean of several estimates of one car, each number by its precision."""
    weight = np.array([1.0 / np.maximum(np.diag(car.covariance), 1e-300) for car in cars])
    value = (weight * np.array([car.value for car in cars])).sum(axis=0) / weight.sum(axis=0)
    return Car(value, np.diag(1.0 / weight.sum(axis=0)))


def _drawn(car: Car, count: int) -> Array:
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(car.value, car.covariance, count, method="eigh").T
    out: Array = np.maximum(drawn, np.array([[MIN_STRENGTH_SHARE * car.value[0]], [0.0], [0.0]]))
    return out
