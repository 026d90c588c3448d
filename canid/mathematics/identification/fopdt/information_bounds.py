"""Cramér-Rao bounds of each channel: what the data alone allow gain, lag and dead time to be known to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.fopdt.fopdt_posterior import Moments
from canid.mathematics.identification.fopdt.reduced_basis import Box
from canid.values.types import Array


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
    every = np.concatenate(J)
    information = every @ known.xx @ every.T / variance + np.diag(np.tile([0.0, *precision(box)], len(J)))
    # a parameter that moves nothing has no information, and is known to no size at all
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(size, size) + 1e-12 * np.eye(len(size))
    # the pseudoinverse, as numpy's pinv takes it, in a fifth of the time
    value, vector = np.linalg.eigh(scaled)
    kept = np.abs(value) > 1e-15 * float(np.abs(value).max())
    covariance = (vector[:, kept] / value[kept]) @ vector[:, kept].T / np.outer(size, size)
    out = []
    for i in range(len(J)):
        P = covariance[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        total = P[1, 1] + P[2, 2] + 2.0 * P[1, 2]
        out.append(Deviations(*(math.sqrt(max(float(x), 0.0)) for x in (P[0, 0], P[1, 1], P[2, 2], total))))
    return tuple(out)
