"""K, tau and dead time of the transfer function B/A by the method of moments.

The moments of an impulse response follow from those of the polynomials: the mean delay of B/A is that of B
minus that of A, and so is the variance (cumulants of a quotient subtract). A lag tau with dead time theta
has mean delay tau + theta and variance tau^2, so tau is the square root of the second and theta the rest of
the first. Intervals by the delta method.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from canid.mathematics.identification import identifiability
from canid.mathematics.identification.armax import confidence_sequence
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array, Channel, Interval

# s after which the anytime interval is narrowest against the plain one: 2 min. It is then 1.76
# times as wide after 20 s, 1.55 after 2 min, 1.61 after 10 min; 1.6 in the mean over ten minutes.
SHARPEST_S = 120.0


def _mean_and_variance(p: Array, at: Array) -> tuple[float, float, Array, Array]:
    """Mean and variance of lags `at` weighted by p, and their gradients by p."""
    total = float(p.sum())
    mean = float(p @ at) / total
    second = float(p @ at**2) / total
    d_mean = (at - mean) / total
    d_variance = (at**2 - second) / total - 2.0 * mean * d_mean
    return mean, second - mean**2, d_mean, d_variance


def channels(
    names: Sequence[str], A: Array, B: Array, nk: int, covariance: Array, dt: float
) -> dict[str, Channel]:
    """Channels of all inputs from the polynomials.

    Args:
        names: of the m inputs.
        A: (na + 1,) with the leading one.
        B: (m, nb).
        nk: samples.
        covariance: of a1..., b_1,1..., b_2,1..., and whatever follows. Where inputs share their poles, what that costs is
            not in it (box_jenkins.py has separate ones).
        dt: s.

    >>> A, B = np.array([1.0, -0.8]), np.array([[0.5], [0.2]])
    >>> found = channels(("gap", "rate"), A, B, 1, 1e-8 * np.eye(3), 0.1)
    >>> {name: round(ch.K.value, 2) for name, ch in found.items()}
    {'gap': 2.5, 'rate': 1.0}
    """
    na, nb = len(A) - 1, B.shape[1]
    out = {}
    for i, name in enumerate(names):
        indices = np.r_[0:na, na + i * nb : na + (i + 1) * nb]
        out[name] = channel(A, B[i], nk, covariance[np.ix_(indices, indices)], dt)
    return out


def channel(A: Array, B: Array, nk: int, covariance: Array, dt: float) -> Channel:
    """Channel of one input from the polynomials.

    Args:
        A: (na + 1,) with the leading one.
        B: (nb,) first coefficient at lag nk.
        nk: samples.
        covariance: (na + nb, na + nb) of a1..., b1....
        dt: s.

    >>> a = np.exp(-0.1 / 0.5)  # a lag of 0.5 s behind a dead time of 0.2 s, input joined by lines
    >>> g = 1 - 0.5 / 0.1 * (1 - a)
    >>> B = 5.0 * np.array([g, 1 - a - g])
    >>> found = channel(np.array([1.0, -a]), B, 2, 1e-8 * np.eye(3), 0.1)
    >>> round(found.K.value, 2), round(found.tau_plus_dead_time.value, 2)
    (5.0, 0.7)
    """
    na = len(A) - 1
    a1, b1 = float(A.sum()), float(B.sum())
    if (
        not np.isfinite(covariance).all()
        or a1 == 0.0
        or b1 == 0.0
        or np.abs(np.roots(A)).max(initial=0.0) >= 1.0
    ):
        return Channel()  # an unstable or integrating answer has no gain
    ma, va, d_ma, d_va = _mean_and_variance(A, np.arange(na + 1.0))
    mb, vb, d_mb, d_vb = _mean_and_variance(B, nk + np.arange(float(len(B))))
    J_mean = dt * np.concatenate([-d_ma[1:], d_mb])
    J_var = dt**2 * np.concatenate([-d_va[1:], d_vb])
    total = dt * (mb - ma)
    # the input was joined by lines: on average over where the dead time falls between samples, that adds
    # dt^2/6 to the variance of the sampled response, and nothing to its mean
    variance = dt**2 * (vb - va) - dt**2 / 6.0

    def sd(J: Array) -> float:
        return math.sqrt(max(float(J @ covariance @ J), 0.0))

    sum_sd = sd(J_mean)
    sum_interval = around(total, sum_sd, 0.0)
    K_interval = ratio(b1, a1, *_sums(covariance, na))
    K_sd = (K_interval.high - K_interval.low) / (2.0 * NORMAL_QUANTILE)
    tau, tau_sd, rest, rest_sd = Interval(), np.nan, Interval(), np.nan
    # a variance within two sd of zero has no square root worth the name
    if variance > 2.0 * sd(J_var):
        lag = variance**0.5
        J_tau = J_var / (2.0 * lag)
        tau_sd, rest_sd = sd(J_tau), sd(J_mean - J_tau)
        # a dead time below zero is a lead, which a lag with dead time cannot be
        if total - lag > -2.0 * rest_sd:
            tau, rest = around(lag, tau_sd, 0.0), around(total - lag, rest_sd, 0.0)
        else:
            tau_sd = np.nan
    status = identifiability.judge(K_interval, K_sd, tau_sd, rest_sd, sum_sd)
    # a response that begins before its cause is no answer at all
    if total < -2.0 * sum_sd:
        status = identifiability.judge(K_interval, K_sd, np.nan, np.nan, np.nan)
        tau = rest = sum_interval = Interval()
    return identifiability.channel(status, K_interval, tau, rest, sum_interval)


def _sums(covariance: Array, na: int) -> tuple[float, float, float]:
    """Variances of B(1) and A(1), and their covariance."""
    return (
        float(covariance[na:, na:].sum()),
        float(covariance[:na, :na].sum()),
        float(covariance[na:, :na].sum()),
    )


def anytime(K: Interval, seconds: float) -> Interval:
    """The interval of K that holds at all times simultaneously while the driver stays the same.

    See confidence_sequence.py for what it promises and for whom; information grows with time.

    Args:
        K: its plain interval.
        seconds: of data that it rests on.

    >>> found = anytime(Interval(5.0, 4.0, 6.0), 120.0)
    >>> round((found.high - found.low) / 2.0, 2)
    1.55
    """
    factor = confidence_sequence.widening(seconds / SHARPEST_S) / NORMAL_QUANTILE
    return Interval(K.value, K.value - factor * (K.value - K.low), K.value + factor * (K.high - K.value))


def ratio(b: float, a: float, vb: float, va: float, vab: float, z: float = NORMAL_QUANTILE) -> Interval:
    """Return the 95 % interval of b / a by Fieller (1954): all K with |b - K a| within its own 95 % interval.

    A(1) of a driver at 10 Hz is small, hence its reciprocal skewed: the delta method's symmetric interval
    covered 0.85 of K in 60 s of simulated car following, this one 0.92 to 0.95.

    Args:
        b: numerator.
        a: denominator.
        vb: variance of b.
        va: variance of a.
        vab: covariance.
        z: standard deviations to each side, instead of those of 95 %.

    Returns:
        The interval; NaN where the denominator may be zero, as every K is then possible.

    >>> round(ratio(2.0, 1.0, 1e-6, 0.0, 0.0).high, 5)
    2.00196
    >>> ratio(2.0, 1.0, 0.0, 1.0, 0.0).low
    nan
    """
    square = a * a - z * z * va
    half = a * b - z * z * vab
    root = half * half - square * (b * b - z * z * vb)
    if not square > 0.0 or not root >= 0.0:
        return Interval()
    # nine digits: the last bits of a quadratic's roots mean nothing
    return Interval(
        round(b / a, 9), round((half - root**0.5) / square, 9), round((half + root**0.5) / square, 9)
    )


def around(value: float, sd: float, least: float = -np.inf) -> Interval:
    """Return the 95 % interval of a Gaussian, cut off at `least`.

    >>> around(1.0, 0.5, 0.5)._replace(high=0.0)
    Interval(value=1.0, low=0.5, high=0.0)
    """
    return Interval(
        max(value, least), max(value - NORMAL_QUANTILE * sd, least), max(value + NORMAL_QUANTILE * sd, least)
    )
