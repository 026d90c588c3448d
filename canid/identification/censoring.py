"""A value of which only an upper bound is known (Tobin 1958), as a weighted pseudo-value of least squares.

Rows whose predecessors are all known count, whatever they are themselves: which rows count is decided before they are
seen (a partial likelihood, Cox 1975), so nothing is selected by the output. `diagnosis.fitting.likelihood` counts the
same rows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.types import Array

# beyond this the bound says nothing more, or what it says is linear
MAX_SD = 30.0


class Pseudo(NamedTuple):
    """A parabola that follows log Phi to second order."""

    value: Array  # (n,) in standard deviations: the residual that least squares is to see
    weight: Array  # (n,) 0 to 1
    freedom: Array  # (n,) by how many values the sum of squares counts


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
    a = np.minimum(np.maximum(bound, -MAX_SD), MAX_SD)
    # Phi by the standard library: the few rows at a bound are not worth importing scipy.special, which takes 0.3 s.
    # 30 sd from the mean it is 5e-198, far from the smallest float.
    of_phi = np.array([math.erfc(x) for x in (a * -(0.5**0.5)).tolist()])
    ratio = (2.0 / math.pi) ** 0.5 * np.exp(-0.5 * a * a) / of_phi
    steep = np.maximum(ratio + a, 1e-12)
    weight = np.minimum(np.maximum(ratio * steep, 0.0), 1.0)
    value = np.where(weight > 1e-12, -1.0 / steep, 0.0)
    # E(residual^2) of the truncated normal is 1 - a ratio; the parabola's own square is weight value^2
    return Pseudo(value, weight, a * ratio + weight * value * value)
