"""K, tau and dead time of each input of a Box-Jenkins model, with the plain intervals of its covariance.

Where a pole is not known, or may lie at the end of its range, gain and delay are averaged over it instead: each lag of a
grid gives a Gaussian for K and one for tau + dead time, and their weights are the likelihoods (a flat prior on the lag up to
MAX_LAG_S, as FOPDT has).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from canid.identification import identifiability
from canid.identification.armax import gain_and_delay
from canid.identification.armax.box_jenkins import MAX_LAG_S, BoxJenkinsFit, Rows, refit
from canid.identification.confidence import MISS, NORMAL_QUANTILE
from canid.types import NAN, Array, Channel, Interval

# s; lags over which an unknown pole is averaged
LAGS_S = (0.1, 0.3, 0.6, 1.0, 1.5, 2.2, MAX_LAG_S)


def channels(names: Sequence[str], fit: BoxJenkinsFit, rows: Rows, dt: float) -> dict[str, Channel]:
    """Channels of all inputs.

    Args:
        names: of the m inputs.
        fit: from `fit_box_jenkins`.
        rows: what it was fitted to.
        dt: s.
    """
    o = fit.orders
    width = o.nb + o.nf
    out = {}
    for i, name in enumerate(names):
        of = np.r_[i * width + o.nb : (i + 1) * width, i * width : i * width + o.nb]
        found = gain_and_delay.channel(fit.F[i], fit.B[i], fit.delays[i], fit.covariance[np.ix_(of, of)], dt)
        sd = math.sqrt(float(fit.covariance[of[0], of[0]]))
        pole, longest = -float(fit.F[i, 1]), math.exp(-dt / MAX_LAG_S)
        known = math.isfinite(found.K.low) and NORMAL_QUANTILE * sd < min(longest - pole, pole + 1.0)
        out[name] = found if known else _averaged(fit, rows, dt, i, found)
    return out


def _averaged(fit: BoxJenkinsFit, rows: Rows, dt: float, i: int, otherwise: Channel) -> Channel:
    parts = [one for lag in LAGS_S if (one := refit(fit, rows, dt, i, lag)) is not None]
    if len(parts) < len(LAGS_S):
        return otherwise
    cost = np.array([one.cost for one in parts])
    best = parts[int(cost.argmin())]
    spacing = np.gradient(np.array(LAGS_S))
    variance = best.law.sd**2 * best.law.inflation * best.variance_inflation
    weight = spacing * np.exp(-0.5 * (cost - cost.min()) / variance)
    weight /= weight.sum()
    moments = np.array([_moments(one, i, dt) for one in parts])
    K, K_sd = _mixture(weight, moments[:, 0], moments[:, 1])
    total, total_sd = _mixture(weight, moments[:, 2], moments[:, 3])
    if not math.isfinite(K.low):
        return otherwise
    status = identifiability.judge(K, K_sd, NAN, NAN, total_sd)
    return identifiability.channel(status, K, Interval(), Interval(), total)


def _moments(fit: BoxJenkinsFit, i: int, dt: float) -> tuple[float, float, float, float]:
    """K, its sd, tau + dead time, its sd; the poles given."""
    o = fit.orders
    of = slice(i * (o.nb + o.nf), i * (o.nb + o.nf) + o.nb)
    P, b, f = fit.covariance[of, of], fit.B[i], fit.F[i]
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
