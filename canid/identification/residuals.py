"""Are residuals what a right model leaves: white, unrelated to past inputs (Ljung 1999, sec. 16.6)."""

from __future__ import annotations

from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from canid.types import NAN, Array

# The 99 % bound of Chen & Ulsoy 2001, fig. 8.
LEVEL = 0.99

# Lags looked at: 2.5 s at 10 Hz, as in Chen & Ulsoy 2001, fig. 8.
LAGS = 25


class Whiteness(NamedTuple):
    """The test of Ljung & Box (1978)."""

    white: bool
    statistic: float  # Q
    bound: float  # Q of white noise stays below in 99 %
    lags: int


class Cross(NamedTuple):
    """Correlation of the residual with one input."""

    correlation: Array  # (2 lags + 1,), lag -lags ... lags; positive: the input was earlier
    bound: float  # each stays within in 99 %
    causal: bool  # none at a lag >= 0 outside: nothing of the answer is left
    feedback: bool  # one at a negative lag outside: the output moves the input, the loop is closed


def chi2_bound(freedom: int, level: float = LEVEL) -> float:
    """Quantile of chi-squared by Wilson & Hilferty (1931), to 0.2 % from five degrees of freedom.

    >>> round(chi2_bound(20), 1)  # tables: 37.57
    37.6
    """
    k = max(freedom, 1)
    z = NormalDist().inv_cdf(level)
    return float(k * (1.0 - 2.0 / (9.0 * k) + z * (2.0 / (9.0 * k)) ** 0.5) ** 3)


def whiteness(e: Array, lags: int = LAGS, fitted: int = 0) -> Whiteness:
    """Ljung & Box: Q = n (n+2) sum r_k^2 / (n-k).

    Args:
        e: (n,) residuals.
        lags: how many.
        fitted: parameters of the noise model, taken off the degrees of freedom.

    >>> whiteness(np.random.default_rng(0).normal(size=600)).white
    True
    >>> whiteness(np.sin(np.arange(600.0))).white
    False
    """
    n = len(e)
    lags = min(lags, n // 4)
    power = float(e @ e)
    if lags <= fitted or not power > 0.0:
        return Whiteness(False, NAN, NAN, 0)
    q = sum((float(e[k:] @ e[:-k]) / power) ** 2 / (n - k) for k in range(1, lags + 1)) * n * (n + 2)
    bound = chi2_bound(lags - fitted)
    return Whiteness(q <= bound, q, bound, lags)


def cross(e: Array, u: Array, lags: int = LAGS) -> Cross:
    """Correlate residuals with an input at positive and negative lags.

    The bound is that of two independent series of which the residual is white.

    Args:
        e: (n,) residuals.
        u: (n,) input.
        lags: each way.

    >>> rng = np.random.default_rng(0)
    >>> cross(rng.normal(size=600), rng.normal(size=600)).causal
    True
    """
    n = len(e)
    e, u = e - e.mean(), u - u.mean()
    size = float(np.linalg.norm(e) * np.linalg.norm(u))
    bound = NormalDist().inv_cdf(0.5 + 0.5 * LEVEL) / n**0.5 if n else NAN
    if not size > 0.0:
        return Cross(np.zeros(2 * lags + 1), bound, True, False)
    r = np.array([_product(e, u, k) for k in range(-lags, lags + 1)]) / size
    return Cross(r, bound, not (np.abs(r[lags:]) > bound).any(), bool((np.abs(r[:lags]) > bound).any()))


def _product(e: Array, u: Array, k: int) -> float:
    if k >= 0:
        return float(e[k:] @ u[: len(u) - k])
    return float(e[:k] @ u[-k:])


# s; how long a movement of the pedal or the wheel lasts: left-over correlation is looked for up to here.
CORRELATED = 2.0


def left_over(scores: Array, plain: Array, lags: int = 20) -> float:
    """How much the colour that whitening left widens variances: the mean ratio of long-run to plain variance.

    Ribatet, Cooley & Davison 2012 (magnitude adjustment of a composite likelihood), with the variance of the
    score by Newey & West 1987. At least one: luck must not narrow an interval.

    Args:
        scores: (k, n) residual times derivative of the prediction, one row per parameter.
        plain: (k, n) the derivatives times the residual's standard deviation.
        lags: samples; 20 are CORRELATED at 10 Hz.

    >>> left_over(np.tile([1.0, -1.0], (1, 50)), np.ones((1, 100)))
    1.0
    """
    # no more lags than a quarter of the data can carry
    lags = min(lags, scores.shape[1] // 4)
    expected = np.einsum("kn,kn->k", plain, plain)
    variance = np.einsum("kn,kn->k", scores, scores)
    for i in range(1, lags + 1):
        variance += 2.0 * (1.0 - i / (lags + 1)) * np.einsum("kn,kn->k", scores[:, i:], scores[:, :-i])
    moving = expected > 0.0
    return max(1.0, float(np.mean(variance[moving] / expected[moving]))) if moving.any() else 1.0
