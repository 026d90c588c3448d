"""Shares with their intervals, and other figures of a table's cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

NOTHING = "–"


def bounds(hits: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Two-sided bounds of a share: Clopper & Pearson 1934.

    Example:
        >>> [round(x, 4) for x in bounds(0, 10)], [round(x, 4) for x in bounds(9, 10)]
        ([0.0, 0.3085], [0.555, 0.9975])
    """
    tail = (1.0 - level) / 2.0
    low = float(beta.ppf(tail, hits, of - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1.0 - tail, hits + 1, of - hits)) if hits < of else 1.0
    return low, high


def upper(hits: int, of: int, level: float = 0.95) -> float:
    """One-sided upper bound of a share: what it is below with this confidence.

    Example:
        >>> round(upper(0, 149), 4), upper(3, 3)
        (0.0199, 1.0)
    """
    return float(beta.ppf(level, hits + 1, of - hits)) if hits < of else 1.0


def share(hits: Sequence[bool]) -> str:
    """Say a share with its 95 % bounds and counts.

    Example:
        >>> share([True] * 9 + [False])
        '90.0 % [55, 100] (9/10)'
    """
    n, k = len(hits), sum(hits)
    if not n:
        return NOTHING
    low, high = bounds(k, n)
    return f"{100 * k / n:.1f} % [{100 * low:.0f}, {100 * high:.0f}] ({k}/{n})"


def rare(hits: Sequence[bool]) -> str:
    """Say a share that must be small, with the bound that it is below.

    Example:
        >>> rare([False] * 149)
        '0.0 % (0/149), ≤ 2.0 %'
    """
    n, k = len(hits), sum(hits)
    return f"{100 * k / n:.1f} % ({k}/{n}), ≤ {100 * upper(k, n):.1f} %" if n else NOTHING


def median(values: Sequence[float]) -> str:
    """Say the median of what is finite, and how many that are.

    Example:
        >>> median([1.0, float("nan"), 3.0])
        '2.00 (2)'
    """
    finite = [x for x in values if np.isfinite(x)]
    return f"{np.median(finite):.2f} ({len(finite)})" if finite else NOTHING


def mean(values: Sequence[float]) -> str:
    """Say the mean, and of how many."""
    return f"{np.mean(values):.2f} ({len(values)})" if len(values) else NOTHING


def seconds(values: Sequence[float]) -> str:
    """Say median, 95th percentile and worst of times.

    Example:
        >>> seconds([1.0, 2.0, 9.0])
        '2.0 / 8.3 / 9.0 s (3)'
    """
    finite = [x for x in values if np.isfinite(x)]
    if not finite:
        return NOTHING
    middle, late = np.quantile(finite, (0.5, 0.95))
    return f"{middle:.1f} / {late:.1f} / {max(finite):.1f} s ({len(finite)})"
