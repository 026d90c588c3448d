"""Values with 95 % intervals and a covariance, from draws of a posterior or a mixture of normal distributions.

The covariance has the standard deviations whose normal 95 % intervals are as wide as those of the distribution: of few
drivers its own variance is that of the widest draws, or infinite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, QUANTILES
from canid.mathematics.population import normal_mixture
from canid.mathematics.population.drive_table import Flags, Index
from canid.mathematics.population.spread import correlations, wide
from canid.values.types import NAN, Array


class Estimates(NamedTuple):
    """Of p parameters, or of p parameters of each of I drivers. NaN: not known."""

    value: Array  # (..., p) median
    low: Array  # of the 95 % interval
    high: Array
    covariance: Array  # (..., p, p)


def of_draws(draws: Array) -> Estimates:
    """Summarise draws.

    Args:
        draws: (D, ..., p).

    Example:
        >>> estimates = of_draws(np.random.default_rng(1).standard_normal((4000, 2)))
        >>> round(float(estimates.high[0]), 1), round(float(estimates.covariance[0, 0]), 1)
        (2.0, 1.0)
    """
    low, value, high = np.quantile(draws, (QUANTILES[0], 0.5, QUANTILES[1]), axis=0)
    return Estimates(value, low, high, _covariance(correlation_of(draws), low, high))


def of_mixture(mean: Array, covariance: Array) -> Estimates:
    """Summarise a mixture of normal distributions of equal weight.

    Args:
        mean: (D, p).
        covariance: (D, p, p).

    Example:
        >>> estimates = of_mixture(np.zeros((5, 1)), 4.0 * np.ones((5, 1, 1)))
        >>> round(float(estimates.high[0]), 2), round(float(estimates.covariance[0, 0]), 2)
        (3.92, 4.0)
    """
    sd = np.sqrt(np.einsum("...kk->...k", covariance))
    value, low, high = normal_mixture.interval(mean, sd)
    return Estimates(value, low, high, _covariance(correlations(covariance).mean(axis=0), low, high))


def correlation_of(draws: Array) -> Array:
    """Correlation matrices of draws, whose tails beyond the 95 % interval are moved to its ends.

    Args:
        draws: (D, ..., p).

    Returns:
        (..., p, p).

    Example:
        >>> x = np.random.default_rng(1).standard_normal((2000, 1)) * np.ones(2)
        >>> np.round(correlation_of(x), 2).tolist()
        [[1.0, 1.0], [1.0, 1.0]]
    """
    low, high = np.quantile(draws, QUANTILES, axis=0)
    x = np.clip(draws, low, high)
    x = x - x.mean(axis=0)
    x = np.moveaxis(x / np.maximum(np.sqrt(np.mean(x**2, axis=0)), 1e-300), 0, -1)
    out = x @ x.swapaxes(-1, -2) / x.shape[-1]
    place = np.arange(draws.shape[-1])
    out[..., place, place] = 1.0
    return np.asarray(out)


def withheld(estimates: Estimates, unknown: Flags) -> Estimates:
    """With NaN for some parameters.

    Args:
        estimates: p parameters.
        unknown: (p,).

    Example:
        >>> withheld(Estimates(*np.ones((3, 1)), np.ones((1, 1))), np.array([True])).value.tolist()
        [nan]
    """
    both = unknown[:, None] | unknown[None, :]
    value, low, high = (np.where(unknown, NAN, x) for x in estimates[:3])
    return Estimates(value, low, high, np.where(both, NAN, estimates.covariance))


def placed(estimates: Estimates, place: Index, others: Estimates, column: Index, p: int) -> Estimates:
    """Of some drivers and parameters -> of all.

    Args:
        estimates: (I', k) estimates.
        place: (I,) a driver's place among them; -1: none.
        others: (k,) estimates, of those that have none.
        column: (k,) places of the parameters.
        p: number of parameters.

    Example:
        >>> known, other = Estimates(*np.ones((3, 1, 1)), np.ones((1, 1, 1))), Estimates(*np.zeros((3, 1)), np.ones((1, 1)))
        >>> placed(known, np.array([0, -1]), other, np.array([1]), 2).value.tolist()
        [[nan, 1.0], [nan, 0.0]]
    """
    has = place >= 0
    numbers = [np.where(has[:, None], x[place], y) for x, y in zip(estimates[:3], others[:3], strict=True)]
    covariance = np.where(has[:, None, None], estimates.covariance[place], others.covariance)
    value, low, high = (wide(x, column, p, 1) for x in numbers)
    return Estimates(value, low, high, wide(covariance, column, p, 2))


def _covariance(correlation: Array, low: Array, high: Array) -> Array:
    sd = (high - low) / (2.0 * NORMAL_QUANTILE)
    return np.asarray(correlation * sd[..., :, None] * sd[..., None, :])
