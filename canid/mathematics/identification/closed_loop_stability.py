"""Stability of the driver's car-following loop, by the argument principle.

The driver's output is an acceleration, so that the loop needs no model of the vehicle: with the speed v and the
headway h about which it is linearised,

    dv/dt = K1 L1 (gap - h v) / v0 - K2 L2 v,   d gap / dt = -v,   L = e^(-dead_time s) / (1 + tau s),

for a vehicle ahead that keeps its speed. Its characteristic equation, f(s) = s^2 + K1 L1 (1 + h s) / v0 + K2 L2 s = 0,
has dead times in it and infinitely many roots; the change of arg f along the imaginary axis counts those to its right.
Of a pedal the vehicle is in the loop too (`VehicleLoop`): its strength multiplies both gains, its engine lags, its drag
damps.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array, Channel, Interval

# Frequencies at which f is evaluated: closer together towards zero, where a headway gain over a high speed acts.
FREQUENCIES = 512
# Draws from the intervals; a share of 97.5 % is known to 1.4 %.
DRAWS = 128
# The highest frequency, as a multiple of that at which s^2 outgrows the rest: from there on arg f stays within 30
# degrees of arg s^2.
ABOVE_CROSSOVER = 4.0


class VehicleLoop(NamedTuple):
    """What lies between the driver's output and the acceleration; as it stands, nothing does."""

    strength: float = 1.0  # m/s² per output unit
    lag: float = 0.0  # s
    damping: float = 0.0  # 1/s, by which the drag grows with the speed


DIRECT = VehicleLoop()


def unstable_roots(
    K: Array, tau: Array, dead_time: Array, speed: float, headway: float, vehicle: VehicleLoop = DIRECT
) -> npt.NDArray[np.int64]:
    """Number of growing modes of the loop.

    Args:
        K: (k, 2) gains of headway in output units per s, and of range rate per m/s; as it stands, in m/s² each.
        tau: (k, 2) s.
        dead_time: (k, 2) s.
        speed: m/s, about which the loop is linearised.
        headway: s, about which the loop is linearised.
        vehicle: from the output to the acceleration.

    Returns:
        (k,).

    >>> K, tau = np.array([[0.3, 0.6], [0.3, 3.0]]), np.full((2, 2), 0.4)
    >>> unstable_roots(K, tau, np.full((2, 2), 0.5), 20.0, 1.5)
    array([0, 2])
    """
    K = K * vehicle.strength
    k1, k2 = np.abs(K).T
    highest = ABOVE_CROSSOVER * (k2 + k1 * headway / speed + np.sqrt(k1 / speed)) + 1e-9
    share = (np.arange(1, FREQUENCIES + 1) / FREQUENCIES) ** 2
    s = 1j * highest[:, None] * share
    L = np.exp(-dead_time[:, :, None] * s[:, None]) / (1.0 + tau[:, :, None] * s[:, None])
    L = L / (1.0 + vehicle.lag * s[:, None])
    f = (
        s * s
        + vehicle.damping * s
        + K[:, :1] / speed * L[:, 0] * (1.0 + headway * s)
        + K[:, 1:] * L[:, 1] * s
    )
    start = np.where(K[:, 0] < 0.0, np.pi, 0.0)
    turns = np.unwrap(np.column_stack([start, np.angle(f)]), axis=1)[:, -1] - start
    # of a function that grows as s^2 half of the contour turns by pi; each root to the right takes pi from it
    out: npt.NDArray[np.int64] = np.rint(1.0 - turns / np.pi).astype(np.int64)
    return out


def unstable_share(
    channels: Sequence[Channel], speed: float, headway: float, vehicle: VehicleLoop = DIRECT
) -> float:
    """Share of what the intervals hold that gives an unstable loop.

    Every parameter is drawn by its own interval: the joint posterior is narrower, so that the share of one that lies
    all in the unstable region is underestimated.

    Args:
        channels: answers to headway and range rate, in m/s².
        speed: m/s, about which the loop is linearised.
        headway: s, about which the loop is linearised.
        vehicle: from the output to the acceleration.

    >>> slow = Channel(Interval(0.3, 0.2, 0.4), Interval(0.4, 0.3, 0.5), Interval(0.5, 0.4, 0.6))
    >>> unstable_share([slow, slow._replace(K=Interval(3.0, 2.7, 3.3))], 20.0, 1.5) > 0.95
    True
    """
    z = iter(_normal())
    drawn = [[_drawn(iv, next(z)) for iv in (c.K, c.tau, c.dead_time)] for c in channels]
    K, tau, dead_time = (np.array(column).T for column in zip(*drawn, strict=True))
    delays = np.maximum(tau, 0.0), np.maximum(dead_time, 0.0)
    return float(np.mean(unstable_roots(K, *delays, speed, headway, vehicle) > 0))


def is_unstable(
    channels: Sequence[Channel], speed: float, headway: float, vehicle: VehicleLoop = DIRECT
) -> bool:
    """Whether the loop is unstable at the estimates themselves."""
    K, tau, dead_time = (
        np.array([[iv.value for iv in column]])
        for column in zip(*((c.K, c.tau, c.dead_time) for c in channels), strict=True)
    )
    return bool(unstable_roots(K, tau, dead_time, speed, headway, vehicle)[0] > 0)


@cache
def _normal() -> tuple[Array, ...]:
    """Six standard normal samples, the same ones always: no estimate may depend on chance."""
    return tuple(np.random.default_rng(0).standard_normal((6, DRAWS)))


def _drawn(iv: Interval, z: Array) -> Array:
    """Two halves of a Gaussian, each as wide as its side of the interval."""
    side = np.where(z < 0.0, iv.value - iv.low, iv.high - iv.value)
    out: Array = iv.value + z * side / NORMAL_QUANTILE
    return out
