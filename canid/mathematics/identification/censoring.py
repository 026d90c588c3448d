"""A value of which only an upper bound is known (Tobin 1958), for least squares.

Rows whose predecessors are all known count, whatever they are themselves: which rows count is decided before they are
seen (a partial likelihood, Cox 1975), so nothing is selected by the output. The likelihood of such a row is
Phi(bound - mean). The estimators, which solve linear equations, take the parabola that follows its logarithm
(`below`); the diagnosis, which iterates, takes a residual whose square it is (`surprise`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.values.types import Array

# beyond this the bound says nothing more, or what it says is linear
MAX_SD = 30.0


class Pseudo(NamedTuple):
    """A parabola that follows log Phi to second order."""

    value: Array  # (n,) in standard deviations: the residual that least squares is to see
    weight: Array  # (n,) 0 to 1
    freedom: Array  # (n,) by how many values the sum of squares counts


class Surprise(NamedTuple):
    """A residual whose square is -2 log Phi."""

    value: Array  # (n,) 0 and more
    slope: Array  # (n,) its derivative by the bound, negative


def surprise(bound: Array) -> Surprise:
    """Return residuals of values of which it is known only that they lie at or below a bound.

    Args:
        bound: (n,) in standard deviations, from the mean.

    >>> one = surprise(np.array([0.0]))
    >>> bool(abs(float(one.value[0]) ** 2 - 2 * math.log(2.0)) < 1e-12)
    True
    """
    _a, of_phi, ratio = _normal(bound)
    value = np.sqrt(np.maximum(-2.0 * np.log(0.5 * of_phi), 1e-12))
    return Surprise(value, -ratio / value)


def _normal(bound: Array) -> tuple[Array, Array, Array]:
    """Return the bound within MAX_SD, 2 Phi there, and the slope of log Phi."""
    a = np.minimum(np.maximum(bound, -MAX_SD), MAX_SD)
    # Phi by the standard library: the few rows at a bound are not worth importing scipy.special, which takes 0.3 s.
    # 30 sd from the mean it is 5e-198, far from the smallest float.
    of_phi = np.array([math.erfc(x) for x in (a * -(0.5**0.5)).tolist()])
    return a, of_phi, (2.0 / math.pi) ** 0.5 * np.exp(-0.5 * a * a) / of_phi


def below(bound: Array) -> Pseudo:
    """Return pseudo-values for residuals of which it is known only that they lie at or below a bound.

    Newton's step on log Phi(bound - shift) at shift 0: slope and curvature of the parabola are those of log Phi.

    Args:
        bound: (n,) in standard deviations of the innovation.

    >>> one = below(np.array([0.0]))
    >>> round(float(one.value[0]), 3), round(float(one.weight[0]), 3)
    (-1.253, 0.637)
    >>> bool(below(np.array([8.0])).weight[0] < 1e-10)  # expected far below: nothing is learnt
    True
    """
    a, _of_phi, ratio = _normal(bound)
    steep = np.maximum(ratio + a, 1e-12)
    weight = np.minimum(np.maximum(ratio * steep, 0.0), 1.0)
    value = np.where(weight > 1e-12, -1.0 / steep, 0.0)
    # E(residual^2) of the truncated normal is 1 - a ratio; the parabola's own square is weight value^2
    return Pseudo(value, weight, a * ratio + weight * value * value)
