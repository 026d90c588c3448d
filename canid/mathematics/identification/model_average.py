"""Interval of a parameter over several models: Bayesian model averaging (Hoeting et al. 1999) of two-piece normals."""

from __future__ import annotations

import math

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, TAIL
from canid.values.types import Array, Interval

LEAST_SD = 1e-9  # in the parameter's unit; instead of zero
HALVINGS = 50  # of the range that an end lies in: to a double's last digits


def widened(
    narrow: Interval, means: Array, sds: Array, odds: Array, quantile: float = NORMAL_QUANTILE
) -> Interval:
    """Widen an interval until it holds 95 % by all models; never narrow it.

    The model that the interval is of counts as a two-piece normal (Wallis 2014), on either side as wide as the interval: a
    normal of their mean width reaches beyond the interval on one side, whatever the other models are.

    Args:
        narrow: of the parameter by one model, finite.
        means: (k,) by the other models.
        sds: (k,) their standard deviations.
        odds: (k,) of the other models against the one.
        quantile: a side of `narrow` in standard deviations.

    >>> from numpy import array
    >>> wide = [widened(Interval(5.0, 4.5, 6.0), array([3.0]), array([0.2]), array([odds])) for odds in (1e-6, 1.0)]
    >>> [round(x.low, 2) for x in wide]
    [4.5, 2.67]
    """
    sides = (narrow.value - narrow.low) / quantile, (narrow.high - narrow.value) / quantile
    models = [(1.0, narrow.value, *(max(side, LEAST_SD) for side in sides))]
    for weight, mean, sd in zip(odds.tolist(), means.tolist(), sds.tolist(), strict=True):
        models.append((weight, mean, max(sd, LEAST_SD), max(sd, LEAST_SD)))
    total = math.fsum(weight for weight, *_ in models)

    def outside(x: float, side: float) -> float:
        """Probability of less than x (side 1) or more (side -1)."""
        parts = (w * math.erfc(side * (m - x) / (a if x < m else b) * 0.5**0.5) for w, m, a, b in models)
        return 0.5 * math.fsum(parts) / total

    def end(inner: float, far: float, side: float) -> float:
        for _ in range(HALVINGS if outside(inner, side) > TAIL else 0):
            middle = 0.5 * (inner + far)
            inner, far = (middle, far) if outside(middle, side) > TAIL else (inner, middle)
        return inner

    low = end(narrow.low, min(m - 2.0 * quantile * a for _, m, a, _ in models), 1.0)
    high = end(narrow.high, max(m + 2.0 * quantile * b for _, m, _, b in models), -1.0)
    return Interval(narrow.value, low, high)
