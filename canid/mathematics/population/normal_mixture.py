"""Quantiles of a mixture of normal distributions: what is normal given each posterior draw of B and W, over all draws.

Of few drives B and W vary much between draws, and the mixture has the tails of Student's t without an approximation of its
degrees of freedom.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from canid.mathematics.identification.confidence import QUANTILES
from canid.values.types import Array

# halvings of the bracket: the quantile is exact to 1e-9 of it
BISECTIONS = 30
# quantiles of every component lie within so many of its standard deviations
WIDEST = 6.0


def quantile(mean: Array, sd: Array, q: float) -> Array:
    """Quantile of an equal-weight mixture.

    Args:
        mean: (D, ...) of the D components.
        sd: (D, ...), not negative.
        q: between 0 and 1.

    Returns:
        (...), NaN where a component is NaN.

    Example:
        >>> round(float(quantile(np.zeros(5), np.ones(5), 0.9)), 2)
        1.28
    """
    low, high = np.min(mean - WIDEST * sd, axis=0), np.max(mean + WIDEST * sd, axis=0)
    # components without width are steps
    width = np.maximum(sd, 1e-12 * (high - low) + 1e-300)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        below = ndtr((middle - mean) / width).mean(axis=0) < q
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(np.where(np.isfinite(mean + sd).all(axis=0), 0.5 * (low + high), np.nan))


def interval(mean: Array, sd: Array) -> tuple[Array, Array, Array]:
    """Median and 95 % interval of the mixture.

    Args:
        mean: (D, ...).
        sd: (D, ...).

    Returns:
        Three times (...).

    Example:
        >>> [round(float(x), 1) for x in interval(np.ones(2), np.array([0.1, 3.0]))]
        [1.0, -3.9, 5.9]
    """
    return quantile(mean, sd, 0.5), quantile(mean, sd, QUANTILES[0]), quantile(mean, sd, QUANTILES[1])
