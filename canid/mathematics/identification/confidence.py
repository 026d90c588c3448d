"""The confidence level of every interval that canid states, 95 % two-sided, and the quantiles that belong to it."""

from __future__ import annotations

import math
from functools import cache

# share of intervals that miss the truth; of each side one half
MISS = 0.05
LEVEL = 1.0 - MISS
TAIL = 0.5 * MISS
# of a bootstrap or a posterior, the ends of the interval
QUANTILES = (TAIL, 1.0 - TAIL)
# standard normal: half the interval's width in standard deviations
NORMAL_QUANTILE = 1.959964
# the same to two decimals, as the diagnosis states its intervals: a report of the same drive keeps its last digits
SIGMAS = 1.96
# chi-squared with one degree of freedom, to two decimals: the fall of 2 log likelihood from its maximum to the ends of a
# profile interval (Wilks 1938)
CHI_SQUARED_QUANTILE = 3.84
# degrees of freedom below which the formula for Student's t is more than 4 % off
MIN_FREEDOM = 3.0


@cache
def student_quantile(freedom: int) -> float:
    """Student's t that `LEVEL` lies within on both sides; `NORMAL_QUANTILE` of as many degrees of freedom as one likes.

    Its distribution is a finite sum (Abramowitz & Stegun 1964, 26.7.3 and 26.7.4), halved until no digit is left: importing
    scipy.special for it takes 0.3 s.

    Args:
        freedom: degrees of freedom, 1 or more.

    >>> [round(student_quantile(freedom), 3) for freedom in (1, 4, 10, 200)]
    [12.706, 2.776, 2.228, 1.972]
    """
    low, high = 0.0, 13.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if _within(middle, freedom) < LEVEL else (low, middle)
    return middle


def student_half_width(freedom: float, normal: float) -> float:
    """Half width of an interval in standard deviations, by Student's t (Gaver & Kafadar 1984): within 4 %.

    Args:
        freedom: degrees of freedom, at least `MIN_FREEDOM`; infinite below.
        normal: the same half width for a normal distribution.

    >>> round(student_half_width(119.0, 2.0), 2), round(student_half_width(119.0, 3.7), 2), student_half_width(2.0, 2.0)
    (2.02, 3.82, inf)
    """
    if freedom < MIN_FREEDOM:
        return math.inf
    return math.sqrt(freedom * math.expm1(normal * normal * (freedom - 1.5) / (freedom - 1.0) ** 2))


def _within(t: float, freedom: int) -> float:
    """Probability of less than t in size."""
    angle = math.atan2(t, math.sqrt(freedom))
    sine, cosine = math.sin(angle), math.cos(angle)
    odd = freedom % 2
    total = term = cosine if odd else 1.0
    for k in range(2 + odd, freedom - 1, 2):
        term *= cosine * cosine * (k - 1) / k
        total += term
    return 2.0 / math.pi * (angle + sine * total * (freedom > 1)) if odd else sine * total
