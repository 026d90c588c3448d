"""Do odd and even segments differ: Welch's t and the F test of the printed means and standard deviations."""

from __future__ import annotations

import math
from typing import NamedTuple

from scipy.stats import f as f_distribution
from scipy.stats import ttest_ind_from_stats

from canid_study.printed_numbers import SEGMENTS, STEERING_TABLES

PARAMETERS = ("a1", "a2", "b1", "b2")


class OddEven(NamedTuple):
    """One parameter of one table."""

    table: int
    parameter: str
    p_mean: float  # two-sided, of equal means
    p_sd: float  # two-sided, of equal variances


def odd_even() -> tuple[OddEven, ...]:
    """Tests of estimation against validation, as if each driver gave all of his segments.

    Rejected segments are not counted in the paper; with fewer the probabilities would be larger.

    Example:
        >>> tests = odd_even()
        >>> round(min(min(t.p_mean, t.p_sd) for t in tests), 2)
        0.08
    """
    out = []
    for number in (1, 2):
        odd, even = (t for t in STEERING_TABLES if t.table == number)
        # 119 segments, numbered from 1: 60 odd and 59 even; before the first one was left out 59 odd and 60 even
        n_odd, n_even = odd.drivers * (SEGMENTS // 2), even.drivers * (SEGMENTS - SEGMENTS // 2)
        for k, name in enumerate(PARAMETERS):
            p_mean = float(
                ttest_ind_from_stats(
                    odd.mean[k], odd.sd[k], n_odd, even.mean[k], even.sd[k], n_even, equal_var=False
                ).pvalue
            )
            ratio = (odd.sd[k] / even.sd[k]) ** 2
            tail = float(f_distribution.cdf(ratio, n_odd - 1, n_even - 1))
            out.append(OddEven(number, name, p_mean, 2.0 * min(tail, 1.0 - tail)))
    return tuple(out)


def other_eleven(parameter: int) -> tuple[float, float]:
    """Mean and standard deviation of the other eleven drivers, from Table 2 of twelve and Table 1 of one.

    Args:
        parameter: 0 to 3, a1 to b2.

    Raises:
        ValueError: no standard deviation of the others agrees with the two tables.

    Example:
        >>> mean, sd = other_eleven(2)
        >>> round(mean, 3), round(sd, 3)
        (3.719, 1.679)
    """
    one, twelve = (
        next(t for t in STEERING_TABLES if t.table == n and t.part == "estimation") for n in (1, 2)
    )
    k, n = parameter, twelve.drivers
    mean = (n * twelve.mean[k] - one.mean[k]) / (n - 1)
    square = (n * (twelve.sd[k] ** 2 + twelve.mean[k] ** 2) - (one.sd[k] ** 2 + one.mean[k] ** 2)) / (
        n - 1
    ) - mean**2
    if square < 0.0:
        raise ValueError(f"parameter {PARAMETERS[k]}: the variance of the others would be {square:.3g}")
    return mean, math.sqrt(square)
