"""Adjusted p-values that control the false discovery rate (Benjamini & Hochberg 1995; Benjamini & Yekutieli 2001).

The share of false ones among all that are called discoveries, on average. Comparison's `multiplicity` controls the chance of
a single false one, which over a fleet of hundreds of drivers leaves no power.
"""

from __future__ import annotations

import numpy as np

from canid.types import NAN, Array

# share of false discoveries that verdicts of this package allow, where they are not asked for another
RATE = 0.05


def adjusted(p: Array, *, dependent: bool = False) -> Array:
    """Adjusted p-values: an entry is a discovery at the rate q where its adjusted value is at most q.

    Args:
        p: (m,) or any shape; NaN: not tested.
        dependent: the tests may depend on each other in any way (Benjamini & Yekutieli 2001, theorem 1.3); without it they
            are independent or positively dependent.

    Returns:
        As `p`; NaN where not tested.

    Example:
        >>> np.round(adjusted(np.array([0.01, 0.02, 0.5, np.nan])), 3).tolist()
        [0.03, 0.03, 0.5, nan]
        >>> np.round(adjusted(np.array([0.01, 0.02, 0.5]), dependent=True), 3).tolist()
        [0.055, 0.055, 0.917]
    """
    flat = np.asarray(p, dtype=np.float64).ravel()
    out = np.full(len(flat), NAN)
    tested = np.flatnonzero(np.isfinite(flat))
    count = len(tested)
    if count:
        order = tested[np.argsort(flat[tested], kind="stable")]
        rank = np.arange(1, count + 1)
        factor = float(np.sum(1.0 / rank)) if dependent else 1.0
        raised = flat[order] * factor * count / rank
        # step-up: the least of what is at or behind each rank
        out[order] = np.minimum(np.minimum.accumulate(raised[::-1])[::-1], 1.0)
    return out.reshape(np.shape(p))
