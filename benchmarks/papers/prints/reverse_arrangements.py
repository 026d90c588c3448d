"""Reverse arrangements test of a trend (Bendat & Piersol 1986, sec. 4.5.2; Kendall 1938)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array

# mean squares of 3 s of a minute: longer than the loop's memory, and 20 are enough for the normal approximation
INTERVALS = 20


def mean_squares(segments: Array, intervals: int = INTERVALS) -> Array:
    """Mean squares over consecutive intervals, (k, intervals).

    Args:
        segments: (k, n).
        intervals: into which each is divided.

    >>> mean_squares(np.array([[1.0, 1.0, 2.0, 2.0]]), 2)
    array([[1., 4.]])
    """
    k, n = segments.shape
    used = n // intervals * intervals
    out: Array = (segments[:, :used].reshape(k, intervals, -1) ** 2).mean(axis=2)
    return out


def z_scores(values: Array) -> Array:
    """Standardised number of pairs i < j with x_i > x_j; positive: falling.

    Args:
        values: (k, n) of independent observations.

    Returns:
        (k,), standard normal where there is no trend.

    >>> z_scores(np.arange(10.0)[None]).round(2)
    array([-4.02])
    """
    n = values.shape[1]
    first, second = np.triu_indices(n, 1)
    count = (values[:, first] > values[:, second]).sum(axis=1)
    out: Array = (count - n * (n - 1) / 4.0) / math.sqrt(n * (2 * n + 5) * (n - 1) / 72.0)
    return out


def passes(segments: Array) -> npt.NDArray[np.bool_]:
    """Whether each segment (k, n) passes at the 95 % level.

    >>> passes(np.ones((1, 40)) * np.linspace(1.0, 3.0, 40))
    array([False])
    """
    out: npt.NDArray[np.bool_] = np.abs(z_scores(mean_squares(segments))) <= NORMAL_QUANTILE
    return out
