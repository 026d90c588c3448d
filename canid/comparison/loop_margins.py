"""Margins and string stability of each drive's driver with its car, at one speed and headway for all of them.

The margins of `identify` belong to the speed and headway of their own drive, which differ; the posterior's draws give them
anew where all drives can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.comparison.drive import DriveEstimates
from canid.identification.confidence import QUANTILES
from canid.systems import following_loop
from canid.systems.following_loop import FollowingLoop
from canid.types import Array, Interval

# name, field of LoopMargins, unit
MARGINS = (
    ("phase_margin", "phase_margin_deg", "°"),
    ("delay_margin", "delay_margin_s", "s"),
    ("string_peak", "string_peak", ""),
)
# share of unstable draws from which on a margin has no interval
MAX_UNSTABLE = 0.025
# a car is drawn no weaker than this share of its estimate, as in systems/posterior_draws.py
MIN_STRENGTH_SHARE = 0.1


class Point(NamedTuple):
    """Where all loops are linearised."""

    speed: float  # m/s
    headway: float  # s


def common_point(drives: Sequence[DriveEstimates]) -> Point | None:
    """Mean of the drives' medians; None: no drive has a loop."""
    loops = [drive.loop for drive in drives if drive.loop is not None and drive.draws is not None]
    if not loops:
        return None
    return Point(
        float(np.mean([loop.speed for loop in loops])), float(np.mean([loop.headway for loop in loops]))
    )


def margins(drive: DriveEstimates, at: Point) -> dict[str, Array]:
    """Draws (n,) of each of `MARGINS`; none where the drive has no loop, or its draws are unstable."""
    if drive.loop is None or drive.draws is None:
        return {}
    of = drive.draws
    loop = FollowingLoop(of.K, of.tau, of.dead_time, at.speed, at.headway)
    if drive.loop.car is not None:
        strength, lag, damping = _cars(drive.loop.car, drive.loop.covariance, len(of.K))
        loop = loop._replace(strength=strength, lag=lag, damping=damping)
    found = following_loop.margins(loop)
    if float(found.unstable.mean()) > MAX_UNSTABLE:
        return {}
    return {name: getattr(found, field) for name, field, _ in MARGINS}


def interval(draws: Array) -> Interval:
    """Median and 95 % interval."""
    low, middle, high = np.quantile(draws, (QUANTILES[0], 0.5, QUANTILES[1]), method="nearest")
    return Interval(float(middle), float(low), float(high))


def _cars(car: tuple[float, float, float], covariance: Array, count: int) -> Array:
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(car, covariance, count, method="eigh").T
    least = np.array([[MIN_STRENGTH_SHARE * car[0]], [0.0], [0.0]])
    out: Array = np.maximum(drawn, least)
    return out
