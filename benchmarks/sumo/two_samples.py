"""How far two samples of one quantity are apart, and how far the halves of one drive are: the yardstick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import energy_distance, ks_2samp, wasserstein_distance

from canid.values.types import Array

# values of a sample that are compared: distances are then known to 0.01, and each takes milliseconds
MOST = 4000


class Distances(NamedTuple):
    """Of two samples."""

    ks: float  # Kolmogorov-Smirnov: largest difference of the distribution functions
    wasserstein: float  # in the quantity's unit: mean shift of the quantiles
    energy: float  # energy distance over the standard deviation of the first one (Székely & Rizzo 2013)


def distances(a: Array, b: Array) -> Distances:
    """Compare two samples.

    Example:
        >>> x = np.arange(1000.0)
        >>> distances(x, x + 500.0)[:2]
        (0.5, 500.0)
    """
    a, b = (x[:: max(x.size // MOST, 1)] for x in (a, b))
    sd = float(np.std(a))
    return Distances(
        float(ks_2samp(a, b).statistic),
        float(wasserstein_distance(a, b)),
        float(energy_distance(a / sd, b / sd)) if sd > 0.0 else float("nan"),
    )


def effective_number(x: Array) -> float:
    """Number of independent values that know a mean as well as these (Geyer 1992, initial positive sequence).

    Example:
        >>> rng = np.random.default_rng(1)
        >>> 900 < effective_number(rng.standard_normal(1000)) <= 1000
        True
    """
    n = x.size
    if n < 4 or not np.std(x) > 0.0:
        return float(min(n, 1))
    y = x - x.mean()
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(y, size)
    r = np.fft.irfft(np.abs(spectrum) ** 2, size)[:n]
    r /= r[0]
    pairs = r[: n // 2 * 2].reshape(-1, 2).sum(axis=1)
    positive = np.flatnonzero(pairs <= 0.0)
    last = int(positive[0]) if positive.size else pairs.size
    return float(min(n / max(2.0 * pairs[:last].sum() - 1.0, 1.0), n))
