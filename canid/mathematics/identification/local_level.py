"""Local-level model of a parameter over a drive: y_i = level_i + e_i, level_i = level_(i-1) + w_i (Harvey 1989, ch. 2).

The variance of w per second by maximum likelihood; the level by a Kalman filter and the RTS smoother, averaged
over what the likelihood leaves open of that variance; and a likelihood ratio test of a constant level. Its null lies on the
boundary, and is no half-and-half mixture with so few windows (Shephard & Harvey 1990), so its distribution is simulated:
with known variances of e it does not depend on the level, and the test is exact. This is Chen & Ulsoy's question (2001).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE, NORMAL_QUANTILE
from canid.values.types import Array, Interval

# windows below which no level is fitted: the variance of five changes is not known to a factor of three
MIN_WINDOWS = 6
# standard deviations of the level over the drive that are tried, against the median standard error of a window: a
# thirtieth is lost among a hundred windows, thirty leaves nothing of the smoothing
SD_GRID = (0.03, 30.0, 30)
# simulated drives of the null: p-values to 0.001
SIMULATIONS = 999
# share of the likelihood below which a variance changes no band
MIN_WEIGHT = 1e-3


class LocalLevel(NamedTuple):
    """A parameter over a drive."""

    t: Array  # (n,) s, middle of each window
    value: Array  # (n,) estimates of the windows
    sd: Array  # (n,) their standard errors
    level: Array  # (n,) smoothed
    low: Array  # (n,) 95 % band
    high: Array  # (n,)
    constant: Interval  # the level if it is constant
    variation: Interval  # sd of the level over the drive
    statistic: float  # likelihood ratio
    p_value: float  # of a constant level


def log_likelihood(values: Array, variance: Array, change: Array) -> Array:
    """Log likelihood of local-level models, the first value given (Harvey 1989, sec. 3.4).

    Args:
        values: (..., n) windows, in time.
        variance: (n,) of each window's error.
        change: (g, n - 1) variances of the level's change from one window to the next.

    Returns:
        (..., g).

    >>> one = log_likelihood(np.array([1.0, 2.0]), np.array([1.0, 1.0]), np.array([[0.0], [2.0]]))
    >>> [round(float(x), 4) for x in one]  # N(0, 2) and N(0, 4) at 1
    [-1.5155, -1.7371]
    """
    level = np.broadcast_to(values[..., :1], (*values.shape[:-1], len(change)))
    P = np.full(len(change), variance[0])
    total = np.zeros(level.shape)
    for i in range(1, values.shape[-1]):
        P = P + change[:, i - 1]
        F = P + variance[i]
        v = values[..., i, None] - level
        total = total - 0.5 * (np.log(2.0 * np.pi * F) + v * v / F)
        level = level + P / F * v
        P = P * variance[i] / F
    return total


def fit(t: Array, value: Array, sd: Array, *, seed: int = 0) -> LocalLevel | None:
    """Fit the model and test whether the level is constant.

    Args:
        t: (n,) s, windows that do not overlap, in time.
        value: (n,) estimates.
        sd: (n,) their standard errors.
        seed: of the simulated null.

    Returns:
        None where there are fewer than `MIN_WINDOWS`.

    >>> rng = np.random.default_rng(1)
    >>> found = fit(40.0 * np.arange(30.0), 5.0 + 0.3 * rng.normal(size=30), np.full(30, 0.3))
    >>> found.constant.low < 5.0 < found.constant.high, found.p_value > 0.01
    (True, True)
    """
    n = len(value)
    if n < MIN_WINDOWS:
        return None
    variance = sd * sd
    spans = np.diff(t)
    whole = float(spans.sum())
    low, high, count = SD_GRID
    # a random walk's sample variance over a time T is on average T/6 of its variance per second
    of_drive = np.concatenate([[0.0], float(np.median(sd)) * np.geomspace(low, high, count)])
    change = 6.0 / whole * of_drive[:, None] ** 2 * spans
    likelihood = log_likelihood(value, variance, change)
    statistic = 2.0 * float(likelihood.max() - likelihood[0])
    null = log_likelihood(
        np.random.default_rng(seed).standard_normal((SIMULATIONS, n)) * sd, variance, change
    )
    simulated = 2.0 * (null.max(axis=1) - null[:, 0])
    p_value = (1.0 + float(np.sum(simulated >= statistic))) / (SIMULATIONS + 1.0)
    possible = of_drive[2.0 * (likelihood.max() - likelihood) <= CHI_SQUARED_QUANTILE]
    variation = Interval(
        float(of_drive[int(np.argmax(likelihood))]), float(possible.min()), float(possible.max())
    )
    # every sd up to the largest is as likely before the data
    weight = np.exp(likelihood - likelihood.max()) * np.gradient(of_drive)
    weight /= weight.sum()
    likely = weight > MIN_WEIGHT
    mean, of_mean = _smoothed(value, variance, change[likely])
    share = float(weight[likely].sum())
    level, square = weight[likely] @ mean / share, weight[likely] @ (of_mean + mean * mean)
    spread = NORMAL_QUANTILE * np.sqrt(np.maximum(square / share - level * level, 0.0))
    precision = float((1.0 / variance).sum())
    middle = float((value / variance).sum()) / precision
    half = NORMAL_QUANTILE * precision**-0.5
    return LocalLevel(
        t,
        value,
        sd,
        level,
        level - spread,
        level + spread,
        Interval(middle, middle - half, middle + half),
        variation,
        statistic,
        p_value,
    )


# variance of the level before the first window, in that window's own: as good as unknown
DIFFUSE = 1e7


def _smoothed(value: Array, variance: Array, change: Array) -> tuple[Array, Array]:
    """Mean and variance (..., n) of the level: Kalman filter, and RTS smoother (Rauch, Tung & Striebel 1965).

    Args:
        value: (n,) windows, in time.
        variance: (n,) of each window's error.
        change: (..., n - 1) variances of the level's change from one window to the next.
    """
    n, some = len(value), change.shape[:-1]
    mean, P = np.empty((*some, n)), np.empty((*some, n))
    before, spread = np.broadcast_to(value[0], some), np.broadcast_to(DIFFUSE * variance[0], some)
    for i in range(n):
        if i:
            spread = spread + change[..., i - 1]
        gain = spread / (spread + variance[i])
        before, spread = before + gain * (value[i] - before), gain * variance[i]
        mean[..., i], P[..., i] = before, spread
    for i in range(n - 2, -1, -1):
        ahead = P[..., i] + change[..., i]
        gain = P[..., i] / ahead
        mean[..., i] += gain * (mean[..., i + 1] - mean[..., i])
        P[..., i] += gain**2 * (P[..., i + 1] - ahead)
    return mean, P


def log_likelihood_of_vectors(values: Array, covariances: Array, change: Array) -> Array:
    """Log likelihood of local-level models of several parameters at once, the first value given.

    Args:
        values: (..., n, d) windows, in time; a window that is NaN in all is missing. The first is known.
        covariances: (n, d, d) of each window's error.
        change: (g, n - 1, d, d) covariances of the level's change from one window to the next.

    Returns:
        (..., g).

    >>> R, change = np.ones((2, 1, 1)), np.array([0.0, 2.0])[:, None, None, None]
    >>> [round(float(x), 4) for x in log_likelihood_of_vectors(np.array([[1.0], [2.0]]), R, change)]
    [-1.5155, -1.7371]
    """
    n, d = values.shape[-2:]
    g = len(change)
    missing = np.asarray(~np.isfinite(values.reshape(-1, n, d)).all(axis=(0, 2)))
    level = np.repeat(values[..., None, 0, :], g, axis=-2)
    P = np.broadcast_to(covariances[0], (g, d, d))
    total = np.zeros(level.shape[:-1])
    for i in range(1, n):
        P = P + change[:, i - 1]
        if missing[i]:
            continue
        F = P + covariances[i]
        root = np.linalg.cholesky(F)
        v = values[..., None, i, :] - level
        whitener = np.linalg.inv(root)
        white = np.einsum("gij,...gj->...gi", whitener, v)
        log_det = 2.0 * np.log(np.einsum("gii->gi", root)).sum(axis=1)
        total = total - 0.5 * (d * np.log(2.0 * np.pi) + log_det + (white * white).sum(axis=-1))
        gain = P @ whitener.swapaxes(1, 2)
        level = level + np.einsum("gij,...gj->...gi", gain, white)
        P = P - gain @ gain.swapaxes(1, 2)
    return total


def smoothed_vectors(values: Array, covariances: Array, change: Array) -> tuple[Array, Array]:
    """Mean (n, d) and covariance (n, d, d) of the level of several parameters, by filterpy's filter and RTS smoother.

    Args:
        values: (n, d) windows, in time; NaN where a window is missing. The first is known.
        covariances: (n, d, d) of each window's error.
        change: (n - 1, d, d) of the level's change.
    """
    from filterpy.kalman import KalmanFilter

    n, d = values.shape
    eye = np.eye(d)
    filtered = KalmanFilter(dim_x=d, dim_z=d)
    filtered.x, filtered.P, filtered.F, filtered.H = values[0][:, None], covariances[0].copy(), eye, eye
    means, states = np.empty((n, d, 1)), np.empty((n, d, d))
    means[0], states[0] = filtered.x, filtered.P
    for i in range(1, n):
        filtered.predict(Q=change[i - 1])
        known = bool(np.isfinite(values[i]).all())
        filtered.update(values[i][:, None] if known else None, R=covariances[i])
        means[i], states[i] = filtered.x, 0.5 * (filtered.P + filtered.P.T)
    if not change.any():
        # a level that does not change is what all windows together say
        return np.broadcast_to(means[-1, :, 0], (n, d)).copy(), np.broadcast_to(states[-1], (n, d, d)).copy()
    Qs = [np.zeros((d, d)), *change]
    smooth, P, _, _ = filtered.rts_smoother(means, states, Fs=[eye] * n, Qs=Qs)
    return np.asarray(smooth, float).reshape(n, d), np.asarray(P, float)
