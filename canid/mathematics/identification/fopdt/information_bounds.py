"""Cramér-Rao bounds of each channel: what the data alone allow gain, lag and dead time to be known to; intervals by them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt.fopdt_posterior import Moments
from canid.mathematics.identification.fopdt.reduced_basis import Box
from canid.values.types import Array, Channel, Identifiable, Interval


def precision(box: Box) -> tuple[float, float]:
    """Prior precision of tau and of dead time by the box alone: one over the variance of a uniform, side^2 / 12."""
    return 12.0 / (box.tau_max - box.tau_min) ** 2, 12.0 / box.dead_time_max**2


class Deviations(NamedTuple):
    """What the data alone allow one channel's parameters to be known to: standard deviations by Cramér and Rao."""

    K: float
    tau: float  # s
    dead_time: float  # s
    total: float  # s, of tau + dead time


def bounds(known: Moments, J: Sequence[Array], variance: float, box: Box) -> tuple[Deviations, ...]:
    """Bound each channel, all of them unknown: the inverse of Fisher's information at one point, and of the box.

    What a lag of one channel leaves open of the other's gain ends with the box: without it a headway lag that nobody
    can know would make the gain of range rate unknown too. Next to what is judged (verdict.py) the box alone is wide.

    Args:
        known: inner products.
        J: per channel (3, m b): weights of the derivatives of the output by K, tau and dead time.
        variance: of the whitened residual.
        box: where tau and dead time may lie.
    """
    all_of_them = covariance(known, J, variance, box)
    out = []
    for i in range(len(J)):
        P = all_of_them[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        total = P[1, 1] + P[2, 2] + 2.0 * P[1, 2]
        out.append(Deviations(*(math.sqrt(max(float(x), 0.0)) for x in (P[0, 0], P[1, 1], P[2, 2], total))))
    return tuple(out)


def covariance(known: Moments, J: Sequence[Array], variance: float, box: Box) -> Array:
    """Covariance (3 m, 3 m) of all parameters by Cramér and Rao; arguments as of `bounds`."""
    every = np.concatenate(J)
    information = every @ known.xx @ every.T / variance + np.diag(np.tile([0.0, *precision(box)], len(J)))
    # a parameter that moves nothing has no information, and is known to no size at all
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(size, size) + 1e-12 * np.eye(len(size))
    # the pseudoinverse, as numpy's pinv takes it, in a fifth of the time
    value, vector = np.linalg.eigh(scaled)
    kept = np.abs(value) > 1e-15 * float(np.abs(value).max())
    out: Array = (vector[:, kept] / value[kept]) @ vector[:, kept].T / np.outer(size, size)
    return out


def robust(
    channel: Channel, slow: Deviations, every: Deviations, box: Box, inflation: float = 1.0
) -> Channel:
    """Widen the intervals of a known tau and dead time to the sandwich variance (Huber 1967; White 1982).

    The estimate moves by the score over the curvature of the likelihood. What the inputs' noise adds to the score it does
    not add to the curvature, which is that of the inputs without it. To their sum, and to a gain, it adds next to nothing.

    Args:
        channel: with the intervals of the posterior; one that is wider stays, and of delays that are not known both.
        slow: bounds by the inputs as vehicles move them: one over the curvature.
        every: bounds by the inputs as they were measured: one over the variance of the score.
        box: where tau and dead time end.
        inflation: of the variances of `every`.

    >>> known = Channel(tau=Interval(0.5, 0.304, 0.696), status=Identifiable.OK)  # sd 0.1
    >>> half, whole = Deviations(1.0, 0.1, 0.1, 0.1), Deviations(1.0, 0.2, 0.1, 0.1)
    >>> [round(x, 2) for x in robust(known, whole, half, Box(0.02, 3.0, 1.5)).tau]  # sd 0.2^2/0.1
    [0.5, 0.02, 1.28]
    >>> robust(known, half, half, Box(0.02, 3.0, 1.5)) == known
    True
    """
    if channel.status is not Identifiable.OK:
        return channel
    by_tau, by_dead_time = (
        math.sqrt(inflation) * a * a / max(b, 1e-12)
        for a, b in ((slow.tau, every.tau), (slow.dead_time, every.dead_time))
    )
    return channel._replace(
        tau=_at_least(channel.tau, by_tau, box.tau_min, box.tau_max),
        dead_time=_at_least(channel.dead_time, by_dead_time, 0.0, box.dead_time_max),
    )


def _at_least(known: Interval, sd: float, least: float, most: float) -> Interval:
    """An interval as wide as a standard deviation makes it, within the box; a wider one stays."""
    factor = 2.0 * NORMAL_QUANTILE * sd / max(known.high - known.low, 1e-12)
    if not factor > 1.0:
        return known
    low, high = (known.value + factor * (end - known.value) for end in (known.low, known.high))
    return Interval(known.value, round(max(low, least), 9), round(min(high, most), 9))
