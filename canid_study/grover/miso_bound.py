"""Bound on the fit of the sum of two models that each fit the same output alone (triangle inequality)."""

from __future__ import annotations


def bound(first_percent: float, second_percent: float) -> tuple[float, float]:
    """Lowest and highest percentage of fit that the sum of two responses can have.

    With |y - y1| = (1 - f1) |y| and |y - y2| = (1 - f2) |y| the sum misses y by y1 + y2 - y = y - e1 - e2, of which the
    length is between 1 and 1 -+ the two shares: each response alone is nearly y, so that the sum is nearly 2 y.

    Args:
        first_percent: fit of the first response, 100 (1 - |y - y1| / |y|), y without its mean.
        second_percent: of the second.

    Example:
        >>> low, high = bound(95.39, 91.06)
        >>> round(low, 2), round(high, 2)
        (-13.55, 13.55)
    """
    missed = (1.0 - first_percent / 100.0) + (1.0 - second_percent / 100.0)
    # two poor fits may cancel: then nothing limits the sum but 100 %
    return -100.0 * missed, 100.0 * min(missed, 1.0)
