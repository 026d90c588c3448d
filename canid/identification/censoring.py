"""A value of which only an upper bound is known (Tobin 1958), as a weighted pseudo-value of least squares.

Rows whose predecessors are all known count, whatever they are themselves: which rows count is decided before they are
seen (a partial likelihood, Cox 1975), so nothing is selected by the output. `diagnosis.fitting.likelihood` counts the
same rows.
"""

from __future__ import annotations

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
    # imported here: it takes 0.3 s, and only who has released the pedal needs it
    from scipy.special import log_ndtr

    a = np.clip(bound, -MAX_SD, MAX_SD)
    ratio = np.exp(-0.5 * a * a - log_ndtr(a)) / np.sqrt(2.0 * np.pi)
    steep = np.maximum(ratio + a, 1e-12)
    weight = np.clip(ratio * steep, 0.0, 1.0)
    value = np.where(weight > 1e-12, -1.0 / steep, 0.0)
    # E(residual^2) of the truncated normal is 1 - a ratio; the parabola's own square is weight value^2
    return Pseudo(value, weight, a * ratio + weight * value * value)
