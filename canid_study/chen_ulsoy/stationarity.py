"""Reverse arrangements test (Bendat & Piersol 1986, sec. 4.5.2), as Chen & Ulsoy 2001 apply it (sec. 2.1).

A 5 % test passes 95 % of stationary segments by construction, and it counts trends only: a driver who is drawn anew every
minute passes over two hours.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array

# mean squares of a segment: 3 s each, longer than the wheel's movements. Bendat & Piersol's table begins at ten
BLOCKS = 20


def statistic(values: Array) -> Array:
    """Standardized number of reverse arrangements along the last axis.

    Of k values in random order it has the mean k (k - 1) / 4 and the variance k (k - 1) (2 k + 5) / 72.

    Args:
        values: (..., k).

    >>> [round(float(x), 2) for x in statistic(np.array([np.arange(20.0), np.arange(20.0)[::-1]]))]
    [-6.16, 6.16]
    """
    k = values.shape[-1]
    later = np.triu(np.ones((k, k), bool), 1)
    reverse = ((values[..., :, None] > values[..., None, :]) & later).sum(axis=(-2, -1))
    out: Array = (reverse - k * (k - 1) / 4.0) / np.sqrt(k * (k - 1) * (2.0 * k + 5.0) / 72.0)
    return out


def passes(x: Array) -> npt.NDArray[np.bool_]:
    """Whether the mean squares of each segment show no trend, at 95 %.

    Args:
        x: (S, N); leading NaN columns, where a residual begins, are left out.

    >>> x = np.random.default_rng(0).normal(size=(2, 600))
    >>> passes(x * np.stack([np.ones(600), np.linspace(1.0, 3.0, 600)])).tolist()
    [True, False]
    """
    known = x[:, np.isfinite(x).any(axis=0)]
    out: npt.NDArray[np.bool_] = np.abs(statistic(_mean_squares(known))) <= NORMAL_QUANTILE
    return out


def whole(x: Array) -> float:
    """Statistic of the segments' mean squares in the order of time; beyond the normal quantile a trend at 95 %.

    Args:
        x: (S, N).
    """
    return float(statistic(np.nanmean(x**2, axis=1))) if len(x) > 1 else float("nan")


def _mean_squares(x: Array) -> Array:
    length = x.shape[1] // BLOCKS
    out: Array = (x[:, : BLOCKS * length] ** 2).reshape(len(x), BLOCKS, length).mean(axis=2)
    return out
