"""K, tau and dead time of each input of a Box-Jenkins model, with the plain intervals of its covariance.

Where a pole is not known, or may lie at the end of its range, gain and delay are averaged over it instead: each lag of a
grid gives a Gaussian for K and one for tau + dead time, and their weights are the likelihoods (a flat prior on the lag up to
MAX_LAG_S, as FOPDT has).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from statistics import NormalDist

import numpy as np

from canid.mathematics.identification import identifiability
from canid.mathematics.identification.armax import gain_and_delay
from canid.mathematics.identification.armax.box_jenkins import BoxJenkinsFit, refit
from canid.mathematics.identification.armax.prediction_errors import Rows
from canid.mathematics.identification.armax.walled_descent import MAX_LAG_S, at_pole_wall
from canid.mathematics.identification.confidence import MISS, NORMAL_QUANTILE
from canid.mathematics.identification.fopdt.channel_mixture import ORDER
from canid.values.types import NAN, Array, Channel, Identifiable, Interval

# s; lags over which an unknown pole is averaged
LAGS_S = (0.1, 0.3, 0.6, 1.0, 1.5, 2.2, MAX_LAG_S)


def channels(names: Sequence[str], fit: BoxJenkinsFit, rows: Rows, dt: float) -> dict[str, Channel]:
    """Channels of all inputs.

    Args:
        names: of the m inputs.
        fit: from `fit_rows`.
        rows: what it was fitted to.
        dt: s.
    """
    out = {}

    @cache
    def refits(over: int) -> list[BoxJenkinsFit]:
        every = (refit(fit, rows, dt, over, lag) for lag in LAGS_S)
        return [refitted for refitted in every if refitted is not None]

    walls = at_pole_wall(fit.theta, fit.orders, len(names), dt)
    for i, name in enumerate(names):
        channel, variance = _fitted(fit, i, dt)
        sd = math.sqrt(variance)
        pole, longest = -float(fit.F[i, 1]), math.exp(-dt / MAX_LAG_S)
        known = math.isfinite(channel.K.low) and NORMAL_QUANTILE * sd < min(longest - pole, pole + 1.0)
        if not known or walls[i]:
            channel = _averaged(refits(i), dt, i, i, channel)
        elif any(walls):
            # the covariance holds the other pole where its wall is: what it may be otherwise belongs in the interval
            over = walls.index(True)
            channel = _averaged(refits(over), dt, over, i, identifiability.not_quotable(channel))
        out[name] = channel
    return out


def _fitted(fit: BoxJenkinsFit, i: int, dt: float) -> tuple[Channel, float]:
    """The channel of an input by the covariance of its poles and B, and the variance of its first pole."""
    o = fit.orders
    width = o.nb + o.nf
    indices = np.r_[i * width + o.nb : (i + 1) * width, i * width : i * width + o.nb]
    plain, robust = (
        gain_and_delay.channel(fit.F[i], fit.B[i], fit.delays[i], by[np.ix_(indices, indices)], dt)
        for by in (fit.covariance, fit.sandwich)
    )
    # of a gain and of tau + dead time the noise of the inputs says next to nothing (fopdt/information_bounds.py)
    least = max(min(plain.status, robust.status, key=ORDER.index), Identifiable.GAIN_ONLY, key=ORDER.index)
    least = min(least, plain.status, key=ORDER.index)
    channel = plain._replace(tau=robust.tau, dead_time=robust.dead_time, status=least)
    return channel, float(fit.covariance[indices[0], indices[0]])


def _averaged(parts: Sequence[BoxJenkinsFit], dt: float, over: int, i: int, otherwise: Channel) -> Channel:
    """Average the answer to input `i` over the lag of input `over`, from the fits at each lag."""
    if len(parts) < len(LAGS_S):
        return otherwise
    cost = np.array([part.cost for part in parts])
    best = parts[int(cost.argmin())]
    spacing = np.gradient(np.array(LAGS_S))
    variance = best.law.sd**2 * best.law.inflation * best.variance_inflation
    weight = spacing * np.exp(-0.5 * (cost - cost.min()) / variance)
    weight /= weight.sum()
    moments = np.array([(_moments if over == i else _free_moments)(part, i, dt) for part in parts])
    known = np.isfinite(moments).all(axis=1)
    if float(weight[known].sum()) < 1.0 - MISS:
        return otherwise
    weight, moments = weight[known] / weight[known].sum(), moments[known]
    K, K_sd = _mixture(weight, moments[:, 0], moments[:, 1])
    total, total_sd = _mixture(weight, moments[:, 2], moments[:, 3])
    if not math.isfinite(K.low):
        return otherwise
    status = identifiability.judge(K, K_sd, NAN, NAN, total_sd)
    return identifiability.channel(status, K, Interval(), Interval(), total)


def _free_moments(fit: BoxJenkinsFit, i: int, dt: float) -> tuple[float, float, float, float]:
    """K, its sd, tau + dead time, its sd, of an input whose pole was fitted."""
    channel, _ = _fitted(fit, i, dt)
    K, total = channel.K, channel.tau_plus_dead_time
    wide = 2.0 * NORMAL_QUANTILE
    return K.value, (K.high - K.low) / wide, total.value, (total.high - total.low) / wide


def _moments(fit: BoxJenkinsFit, i: int, dt: float) -> tuple[float, float, float, float]:
    """K, its sd, tau + dead time, its sd; the poles given."""
    o = fit.orders
    b_rows = slice(i * (o.nb + o.nf), i * (o.nb + o.nf) + o.nb)
    P, b, f = fit.covariance[b_rows, b_rows], fit.B[i], fit.F[i]
    at = fit.delays[i] + np.arange(o.nb)
    total, pole = float(b.sum()), float(f.sum())
    mean = float(b @ at) / total
    gradient = (at - mean) / total
    lag = float(f @ np.arange(len(f))) / pole
    return (
        total / pole,
        math.sqrt(max(float(P.sum()), 0.0)) / abs(pole),
        dt * (mean - lag),
        dt * math.sqrt(max(float(gradient @ P @ gradient), 0.0)),
    )


def _mixture(weight: Array, mean: Array, sd: Array) -> tuple[Interval, float]:
    """Median and 95 % interval of a mixture of Gaussians, and its standard deviation.

    >>> interval, sd = _mixture(np.array([1.0]), np.array([2.0]), np.array([0.5]))
    >>> [round(x, 2) for x in interval], sd
    ([2.0, 1.02, 2.98], 0.5)
    """
    if not (np.isfinite(mean).all() and (sd > 0.0).all()):
        return Interval(), NAN
    average = float(weight @ mean)
    spread = math.sqrt(float(weight @ (sd**2 + (mean - average) ** 2)))
    parts = [NormalDist(m, s) for m, s in zip(mean.tolist(), sd.tolist(), strict=True)]

    def quantile(p: float) -> float:
        low, high = float((mean - 8.0 * sd).min()), float((mean + 8.0 * sd).max())
        for _ in range(60):
            middle = 0.5 * (low + high)
            below = sum(w * part.cdf(middle) for w, part in zip(weight.tolist(), parts, strict=True))
            low, high = (middle, high) if below < p else (low, middle)
        return round(0.5 * (low + high), 9)

    return Interval(quantile(0.5), quantile(MISS / 2.0), quantile(1.0 - MISS / 2.0)), spread
