"""Difference and ratio of two independent estimates from their intervals, which may be skewed: MOVER.

Zou & Donner 2008 (Statistics in Medicine 27, 1693): each end of the difference's interval takes the ends of the two
intervals that lie towards it. Donner & Zou 2012 (Statistical Methods in Medical Research 21, 347) give the ratio: all r for
which the interval of b - r a holds 0, so ratio and difference never contradict each other.
"""

from __future__ import annotations

import math

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Interval


def difference(a: Interval, b: Interval, stretch: float = 1.0) -> Interval:
    """Interval of b - a.

    Args:
        a: one estimate.
        b: the other, independent.
        stretch: half-widths over those of a 95 % interval.

    >>> [round(x, 2) for x in difference(Interval(5.0, 4.0, 6.0), Interval(8.0, 6.0, 12.0))]
    [3.0, 0.76, 7.12]
    """
    d = b.value - a.value
    below = stretch * math.hypot(b.value - b.low, a.high - a.value)
    above = stretch * math.hypot(b.high - b.value, a.value - a.low)
    return Interval(d, d - below, d + above)


def z_score(difference: Interval) -> float:
    """Standard normal score of a difference: its value over the half-width towards 0, in standard deviations.

    >>> round(z_score(Interval(3.0, 0.0, 9.0))), z_score(Interval(0.0, -1.0, 1.0)), z_score(Interval(0.0, 0.0, 0.0))
    (2, 0.0, 0.0)
    """
    half = difference.value - difference.low if difference.value > 0.0 else difference.high - difference.value
    if difference.value == 0.0:
        return 0.0
    return (
        NORMAL_QUANTILE * difference.value / half if half > 0.0 else math.copysign(math.inf, difference.value)
    )


def ratio(a: Interval, b: Interval, stretch: float = 1.0) -> Interval:
    """Interval of b / a, of two numbers that are both above 0 or both below; else empty.

    Args:
        a: the denominator.
        b: the numerator, independent.
        stretch: half-widths over those of a 95 % interval.

    >>> [round(x, 2) for x in ratio(Interval(4.0, 3.0, 5.0), Interval(8.0, 7.0, 9.0))]
    [2.0, 1.54, 2.73]
    >>> ratio(Interval(1.0, -0.5, 2.5), Interval(8.0, 7.0, 9.0))
    Interval(value=nan, low=nan, high=nan)
    """
    if a.high < 0.0 and b.high < 0.0:
        return ratio(_negative(a), _negative(b), stretch)
    a, b = _stretched(a, stretch), _stretched(b, stretch)
    if not (a.low > 0.0 and b.value > 0.0):
        return Interval()
    return Interval(b.value / a.value, _end(a, b, lower=True), _end(a, b, lower=False))


def _end(a: Interval, b: Interval, *, lower: bool) -> float:
    """Root of (b - r a)² = spread of b² + r² spread of a², each towards the end that is sought."""
    of_b = (b.value - b.low) if lower else (b.high - b.value)
    of_a = (a.high - a.value) if lower else (a.value - a.low)
    # r² (a² - of_a²) - 2 r a b + b² - of_b² = 0
    lead, middle, last = a.value**2 - of_a**2, a.value * b.value, b.value**2 - of_b**2
    left = math.sqrt(max(middle**2 - lead * last, 0.0))
    if lower:
        # an upper half-width beyond the value leaves the root with the smaller denominator
        return last / (middle + left)
    return (middle + left) / lead


def _stretched(interval: Interval, by: float) -> Interval:
    return Interval(
        interval.value,
        interval.value - by * (interval.value - interval.low),
        interval.value + by * (interval.high - interval.value),
    )


def _negative(interval: Interval) -> Interval:
    return Interval(-interval.value, -interval.high, -interval.low)
