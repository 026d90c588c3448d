"""Standard deviations and correlations of a covariance matrix from draws of its posterior."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import LEVEL, QUANTILES
from canid.mathematics.population.drive_table import Flags, Index
from canid.values.types import NAN, Array

# the shortest interval begins at 0 where its lowest draws are this small against its upper end: a spread of 5 % of what is
# still possible is none that could be seen
ZERO = 0.05


class Spread(NamedTuple):
    """Of p parameters. NaN: not identifiable."""

    value: Array  # (p,) standard deviation, posterior median
    low: Array  # (p,) of the 95 % interval; 0: no spread explains the drives as well
    high: Array
    covariance: Array  # (p, p) of the medians of standard deviations and the means of correlations
    correlation: Array  # (p, p) posterior mean
    correlation_low: Array  # (p, p) 95 % interval
    correlation_high: Array


def of_draws(draws: Array, unknown: Flags, column: Index, p: int) -> Spread:
    """Summarise.

    Args:
        draws: (D, k, k) covariance matrices.
        unknown: (k,) parameters whose spread the data say nothing about.
        column: (k,) their places among all parameters.
        p: number of all.

    Example:
        >>> draws = np.random.default_rng(1).gamma(50.0, 0.02, 4000)[:, None, None] ** 2
        >>> sd = of_draws(draws, np.array([False]), np.array([0]), 1)
        >>> [round(float(x[0]), 1) for x in (sd.value, sd.low, sd.high)]
        [1.0, 0.7, 1.3]
    """
    sd = np.sqrt(np.einsum("dkk->dk", draws))
    correlation = correlations(draws)
    low, high = interval(sd)
    value = np.median(sd, axis=0)
    mean = correlation.mean(axis=0)
    # the mean of correlation matrices is one
    covariance = mean * value[:, None] * value[None, :]
    for x in (value, low, high):
        x[unknown] = NAN
    ends = np.quantile(correlation, QUANTILES, axis=0)
    matrices = [covariance, mean, ends[0], ends[1]]
    for matrix in matrices:
        matrix[unknown] = NAN
        matrix[:, unknown] = NAN
    return Spread(
        *(wide(x, column, p, 1) for x in (value, low, high)), *(wide(x, column, p, 2) for x in matrices)
    )


def correlations(covariance: Array) -> Array:
    """Correlation matrices of covariance matrices.

    Args:
        covariance: (..., k, k).

    Example:
        >>> correlations(np.array([[4.0, 1.0], [1.0, 1.0]])).tolist()
        [[1.0, 0.5], [0.5, 1.0]]
    """
    sd = np.sqrt(np.einsum("...kk->...k", covariance))
    return np.asarray(covariance / (sd[..., :, None] * sd[..., None, :]))


def interval(sd: Array) -> tuple[Array, Array]:
    """95 % interval of equal tails of draws of standard deviations; it begins at 0 where 0 is as likely as more.

    An interval of equal tails never holds 0, which is what drives of one person labelled as several have. Where the shortest
    interval begins at its lowest draws, the density does not fall towards 0.

    Args:
        sd: (D, k).

    Returns:
        Low and high ends, (k,) each.

    Example:
        >>> low, high = interval(np.abs(np.random.default_rng(1).standard_normal((4000, 1))))
        >>> float(low[0]), round(float(high[0]), 1)
        (0.0, 2.3)
    """
    ordered = np.sort(sd, axis=0)
    count = len(ordered)
    inside = min(count - 1, int(np.ceil(LEVEL * count)))
    width = ordered[inside:] - ordered[: count - inside]
    shortest = ordered[np.argmin(width, axis=0), np.arange(sd.shape[1])]
    low, high = np.quantile(ordered, QUANTILES, axis=0)
    return np.where(shortest < ZERO * high, 0.0, low), high


def wide(x: Array, column: Index, p: int, axes: int) -> Array:
    """Of some parameters -> of all, NaN elsewhere; along the last axis or the last two.

    Args:
        x: (..., k) or (..., k, k).
        column: (k,) places.
        p: number of all.
        axes: 1 or 2.

    Example:
        >>> wide(np.array([1.0]), np.array([1]), 2, 1).tolist()
        [nan, 1.0]
    """
    out = np.full((*x.shape[: x.ndim - axes], *(p,) * axes), NAN)
    if axes == 1:
        out[..., column] = x
    else:
        out[..., column[:, None], column[None, :]] = x
    return out
