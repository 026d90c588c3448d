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
    # scipy.stats takes half a second to import
    from scipy.stats import false_discovery_control

    values = np.asarray(p, dtype=np.float64)
    out = np.full(values.shape, NAN)
    tested = np.isfinite(values)
    if tested.any():
        out[tested] = false_discovery_control(values[tested], method="by" if dependent else "bh")
    return out
