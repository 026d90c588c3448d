"""Tests behind the verdicts of a study of logs: "holds" and "fails" only where a test of a stated level says so.

Each test takes the claim against its opposite with a margin, in both directions (two one-sided tests, Schuirmann 1987):
the data can say that it holds, that it fails, or neither, and then it is not decided.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import binomtest, norm, spearmanr, wilcoxon

from canid.mathematics.identification.confidence import MISS, NORMAL_QUANTILE
from canid.values.types import NAN, Array, Interval
from canid_study.artifact import ClaimVerdict

# chance that a verdict is wrong where the truth is at its margin
LEVEL = MISS


def decided(holds: float, fails: float) -> ClaimVerdict:
    """A verdict from two p values.

    Args:
        holds: of the data if the claim were false.
        fails: of the data if it were true.

    Returns:
        "not checkable" where neither is known, "not decided" where neither is at the level.

    >>> [decided(*p).value for p in ((0.01, 0.99), (0.99, 0.01), (0.3, 0.7), (float("nan"), float("nan")))]
    ['holds', 'fails', 'not decided', 'not checkable']
    """
    if not np.isfinite(holds) and not np.isfinite(fails):
        return ClaimVerdict.NOT_CHECKABLE
    if fails <= LEVEL:
        return ClaimVerdict.FAILS
    return ClaimVerdict.HOLDS if holds <= LEVEL else ClaimVerdict.UNDECIDED


def stated(test: str, holds: float, fails: float) -> str:
    """The test of a verdict in words, with its p value and level.

    >>> stated("signed ranks", 0.004, 0.996)
    'signed ranks, p 0.004, level 5 %'
    """
    known = [p for p in (holds, fails) if np.isfinite(p)]
    p = f"p {min(known):.2g}" if known else "too few data"
    return f"{test}, {p}, level {100 * LEVEL:g} %"


def above(values: Sequence[float] | Array, limit: float = 0.0) -> tuple[float, float]:
    """P values of values that lie above a limit, and below it (Wilcoxon 1945, signed ranks).

    Returns:
        NaN twice where no value differs from the limit.

    >>> [round(p, 3) for p in above([1.0, 2.0, 3.0, 4.0, 5.0])]
    [0.031, 1.0]
    """
    x = np.asarray(values, float) - limit
    x = x[np.isfinite(x) & (x != 0.0)]
    if not len(x):
        return NAN, NAN
    return float(wilcoxon(x, alternative="greater").pvalue), float(wilcoxon(x, alternative="less").pvalue)


def more_than(count: int, n: int, share: float) -> float:
    """P value of at least so many where each has the given chance (binomial).

    >>> round(more_than(5, 5, 0.5), 3), more_than(0, 5, 0.5)
    (0.031, 1.0)
    """
    return float(binomtest(count, n, share, alternative="greater").pvalue) if n else NAN


def fewer_than(count: int, n: int, share: float) -> float:
    """P value of at most so many where each has the given chance (binomial).

    >>> round(fewer_than(0, 5, 0.5), 3), fewer_than(5, 5, 0.5)
    (0.031, 1.0)
    """
    return float(binomtest(count, n, share, alternative="less").pvalue) if n else NAN


def small(value: Array, standard_error: Array, margin: Array) -> tuple[float, float]:
    """P values of numbers that are all smaller in size than a margin, and of one at least that is larger.

    The first is the largest of all (an intersection of claims), the second the smallest times their number (Bonferroni).

    >>> [round(p, 3) for p in small(np.array([0.1, -0.1]), np.array([0.1, 0.1]), np.array([0.5, 0.5]))]
    [0.0, 1.0]
    """
    size = np.abs(np.asarray(value, float))
    z = (size - margin) / np.maximum(standard_error, 1e-300)
    if not len(z) or not np.isfinite(z).all():
        return NAN, NAN
    return float(norm.cdf(z).max()), float(min(norm.sf(z).min() * len(z), 1.0))


def within(value: float, truth: Interval, share: float) -> tuple[float, float]:
    """P values of a truth that is near to a value, and of one that is another, from a 95 % interval of the truth.

    Args:
        value: the number that is claimed.
        truth: the truth with its interval.
        share: of the value, by which the truth may differ and the claim still holds.

    >>> [round(p, 3) for p in within(5.0, Interval(5.05, 4.95, 5.15), 0.1)]
    [0.0, 1.0]
    >>> [round(p, 3) for p in within(5.0, Interval(9.0, 8.0, 10.0), 0.1)]
    [1.0, 0.0]
    """
    sd = (truth.high - truth.low) / (2.0 * NORMAL_QUANTILE)
    return small(np.array([truth.value - value]), np.array([sd]), np.array([share * abs(value)]))


def rank_correlation(x: Sequence[float], y: Sequence[float]) -> tuple[float, float, float]:
    """Spearman's rank correlation, and the p values of a negative and of a positive one.

    Equal values share their mean rank, so that the order of the records says nothing.

    Returns:
        NaN where there are fewer than three records or one side is constant.

    >>> [round(v, 3) for v in rank_correlation([1, 2, 3, 4, 5, 6], [9, 7, 7, 5, 4, 3])]
    [-0.986, 0.0, 1.0]
    """
    if len(x) < 3 or len(set(x)) < 2 or len(set(y)) < 2 or not np.isfinite([*x, *y]).all():
        return NAN, NAN, NAN
    negative = spearmanr(x, y, alternative="less")
    return (
        float(negative.statistic),
        float(negative.pvalue),
        float(spearmanr(x, y, alternative="greater").pvalue),
    )
