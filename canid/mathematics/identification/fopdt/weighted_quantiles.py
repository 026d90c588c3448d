"""Median and 95 % interval of weighted points, cells and mixtures of Gaussians."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

from canid.mathematics.identification.confidence import QUANTILES
from canid.values.types import Array, Interval

GAUSSIAN_POINTS = np.array(
    [NormalDist().inv_cdf((i + 0.5) / 41) for i in range(41)]
)  # quantile points that stand for a Gaussian


def quantiles(x: Array, w: Array) -> Interval:
    """Median and 95 % interval of weighted points, the cumulated weight joined by lines.

    >>> quantiles(np.linspace(0.0, 1.0, 101), np.full(101, 1 / 101))
    Interval(value=0.5, low=0.02025, high=0.97975)
    """
    order = np.argsort(x, kind="stable")
    x, w = x[order], w[order]
    c = np.cumsum(w) - 0.5 * w
    low, value, high = np.interp((QUANTILES[0], 0.5, QUANTILES[1]), c / float(w.sum()), x)
    return Interval(round(float(value), 9), round(float(low), 9), round(float(high), 9))


def cell_quantiles(
    middle: Array, half: Array, w: Array, least: float = -np.inf, most: float = np.inf
) -> Interval:
    """Median and 95 % interval of weighted cells, the weight of each spread evenly over its width.

    Args:
        middle: (c,) of the cells.
        half: (c,) half of their widths.
        w: (c,) weights.
        least: limit of the quantity, at which cells end; a leaning cell may reach beyond it.
        most: the upper one.

    >>> cell_quantiles(np.array([0.5, 1.5]), np.array([0.5, 0.5]), np.array([1.0, 1.0]))
    Interval(value=1.0, low=0.05, high=1.95)
    """
    full = w > MIN_WEIGHT * float(w.max())
    w, low = w[full], np.maximum(middle[full] - half[full], least)
    width = np.maximum(np.minimum(middle[full] + half[full], most) - low, 1e-12)
    density = w / width
    ends = np.concatenate([low, low + width])
    order = np.argsort(ends)
    ends = ends[order]
    # the density changes at the ends of cells; its integral is the weight below
    of_all = np.cumsum(np.concatenate([density, -density])[order])
    below = np.zeros(len(ends))
    np.cumsum(of_all[:-1] * (ends[1:] - ends[:-1]), out=below[1:])
    below /= float(w.sum())
    first, value, last = np.interp((QUANTILES[0], 0.5, QUANTILES[1]), below, ends)
    return Interval(round(float(value), 9), round(float(first), 9), round(float(last), 9))


# weight, in shares of the fullest cell's, below which a pair of cells changes no interval
MIN_WEIGHT = 1e-4


def mixture_quantiles(weight: Array, K: Array, sd: Array) -> Interval:
    """Mix the Gaussians of all cells, gathered into 32 bins of their means."""
    low, high = float(K.min()), float(K.max())
    bins = 32
    index = ((K - low) * ((bins - 1e-9) / (high - low + 1e-300))).astype(np.int64)
    mass = np.bincount(index, weight, bins)
    full = mass > 0.0
    mass_full = mass[full]
    mean = np.bincount(index, weight * K, bins)[full] / mass_full
    variance = np.bincount(index, weight * (sd * sd + K * K), bins)[full] / mass_full - mean**2
    width = np.sqrt(np.maximum(variance, 0.0))
    points = mean[:, None] + width[:, None] * GAUSSIAN_POINTS
    return quantiles(points.ravel(), np.repeat(mass_full, len(GAUSSIAN_POINTS)))
