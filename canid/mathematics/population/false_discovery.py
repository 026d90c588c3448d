"""Adjusted p-values that control the false discovery rate (Benjamini & Hochberg 1995; Benjamini & Yekutieli 2001).

The share of false ones among all that are called discoveries, on average. Comparison's `multiplicity` controls the chance of
a single false one, which over a fleet of hundreds of drivers leaves no power.
"""

from __future__ import annotations

import numpy as np

from canid.values.types import NAN, Array

# share of false discoveries that verdicts of this package allow, where they are not asked for another
RATE = 0.05


def adjusted(p: Array, *, dependent: bool = False) -> Array:
    """Adjusted p-values: an entry is a discovery at the rate q where its adjusted value is at most q.

    Args:
        p: (m,) or any shape; NaN: not tested.
        dependent: the tests may depend on each other in any way (Benjamini & Yekutieli 2001, theorem 1.3); without it they
            are independent or positively dependent.

    Raises:
        ValueError: an entry is no probability.

    Returns:
        As `p`; NaN where not tested.

    Example:
        >>> np.round(adjusted(np.array([0.01, 0.02, 0.5, np.nan])), 3).tolist()
        [0.03, 0.03, 0.5, nan]
        >>> np.round(adjusted(np.array([0.01, 0.02, 0.5]), dependent=True), 3).tolist()
        [0.055, 0.055, 0.917]
    """
    values = np.asarray(p, dtype=np.float64)
    out = np.full(values.shape, NAN)
    tested = np.isfinite(values)
    if tested.any():
        out[tested] = _step_up(values[tested], dependent)
    return out


def _step_up(p: Array, dependent: bool) -> Array:
    """Least rate at which each is a discovery; in numpy, since scipy.stats takes half a second to import."""
    if p.min() < 0.0 or p.max() > 1.0:
        raise ValueError(f"p-values must lie within 0 and 1, not {p.min():g} to {p.max():g}")
    order, rank = np.argsort(p), np.arange(1, p.size + 1)
    factor = float(np.sum(1.0 / rank)) if dependent else 1.0
    least = np.minimum.accumulate((p[order] * p.size * factor / rank)[::-1])[::-1]
    out = np.empty(p.size)
    out[order] = np.minimum(least, 1.0)
    return out
