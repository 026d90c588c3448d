"""Continuous poles and zero, and DC gain, of each segment's model (Chen & Ulsoy 2001, sec. 4.1, Fig. 12)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array


class PolesAndGain(NamedTuple):
    """Of S models."""

    poles: npt.NDArray[np.complex128]  # (S, 2) 1/s, the slower one first
    zero: Array  # (S,) 1/s; NaN where it is negative in z
    gain: Array  # (S,) degrees per m
    gain_half: Array  # (S,) half width of its 95 % interval


def poles_and_gain(model: Array, covariance: Array, dt: float) -> PolesAndGain:
    """Map z = e^(s dt), as the paper does; the gain's interval by the delta method.

    Args:
        model: (S, 4) a1, a2, b1, b2.
        covariance: (S, 4, 4).
        dt: s.

    >>> poles = poles_and_gain(np.array([[-1.2623, 0.3697, 4.134, -4.0337]]), np.zeros((1, 4, 4)), 0.1)
    >>> poles.poles.real.round(2)[0], poles.zero.round(3)[0], poles.gain.round(3)[0]
    (array([-2.23, -7.72]), np.float64(-0.246), np.float64(0.934))
    """
    a1, a2, b1, b2 = model.T
    root = np.sqrt((a1 * a1 - 4.0 * a2).astype(complex))
    z = np.stack([-a1 + root, -a1 - root], axis=1) / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.log(z) / dt
        zero = np.log(np.where(-b2 / b1 > 0.0, -b2 / b1, np.nan)) / dt
        below = 1.0 + a1 + a2
        gain = (b1 + b2) / below
        slope = np.stack([-gain / below, -gain / below, 1.0 / below, 1.0 / below], axis=1)
        half = NORMAL_QUANTILE * np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", slope, covariance, slope), 0.0))
    return PolesAndGain(np.asarray(s, np.complex128), zero, gain, half)
