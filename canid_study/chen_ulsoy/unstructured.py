"""Unstructured uncertainty |Delta|: the response from lateral error to what the model leaves (Chen & Ulsoy 2001, sec. 3).

n = angle - (B/A) error, and |Delta| is the frequency response of an ARX(2) model from the error to n. In a closed loop such
a regression finds a response even where none is left, since the error holds the driver's own noise; so each segment has a
null band: the same statistic of repetitions of its own loop, whose driver *is* the fitted model.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import LEVEL
from canid.values.types import NAN, Array
from canid_study.chen_ulsoy.closed_loop import Car, repeat
from canid_study.chen_ulsoy.segment_fits import Fits, fit_segments, reasonable, solve

Complex = npt.NDArray[np.complex128]

# Hz; to 1 Hz, above which the paper discards it (sec. 4.1). From one period in 20 s: below, a minute holds too few periods
FREQUENCIES = np.geomspace(0.05, 1.0, 30)
# s; the start of the simulated response is left out: poles of 2 1/s have settled to 1 %
SETTLE_S = 3.0
# relative to the trace: an n that is zero has no lags to regress on, and the answer of least norm is none
_RIDGE = 1e-12
# segments times repetitions that are simulated at once: 600 samples of 3,000 take 30 MB
_AT_ONCE = 3000


class NullBand(NamedTuple):
    """Delta of repetitions whose driver has no unmodeled dynamics."""

    segment: (
        Array  # (S, F) 95 % quantile of |Delta| of each segment's repetitions; NaN where its loop runs away
    )
    mean: Complex  # (F,) mean of Delta over segments, averaged over the repetitions: feedback alone gives it
    precision: (
        Array  # (F, 2, 2) inverse covariance of that mean's real and imaginary part between repetitions
    )
    limit: float  # squared distance that 5 % of repetitions reach at any frequency (a simultaneous band)
    lost: int  # segments without a band


class Excess(NamedTuple):
    """How far Delta exceeds its null band."""

    share: float  # of segments and frequencies with |Delta| above the band of their own; about 0.05 where nothing is left
    distance: Array  # (F,) squared distance of the mean Delta from its null, in standard deviations
    frequencies: float  # share of frequencies at which that exceeds the simultaneous band
    systematic: Array  # (F,) |mean Delta - its null mean|: what is left over of dynamics


def left(angle: Array, error: Array, theta: Array, na: int = 2, nb: int = 2) -> Array:
    """What the model leaves of the angle: n = angle - (B/A) error - c0/A(1), from rest at the first error.

    Args:
        angle: (S, N).
        error: (S, N).
        theta: (S, n) a1..., b1..., c0.
        na: order of A.
        nb: coefficients of B.

    Returns:
        (S, N).

    >>> y = np.random.default_rng(0).normal(size=(1, 100))
    >>> theta = np.array([[-0.5, 0.0, 1.0, 0.0, 0.2]])
    >>> z = left(np.zeros((1, 100)), y, theta)
    >>> bool(abs(left(-z, y, theta)).max() < 1e-12)
    True
    """
    S, N = angle.shape
    a, b, c0 = theta[:, :na], theta[:, na : na + nb], theta[:, na + nb]
    lag = max(na, nb)
    with np.errstate(all="ignore"):
        rest = (b.sum(axis=1) * error[:, 0] + c0) / (1.0 + a.sum(axis=1))
        y = np.concatenate([np.repeat(error[:, :1], lag, axis=1), error], axis=1).T
        z = np.empty((N + lag, S))
        z[:lag] = rest
        drive = c0 + sum(b[:, k] * y[lag - 1 - k : N + lag - 1 - k] for k in range(nb))
        for t in range(N):
            now = drive[t]
            for k in range(na):
                now = now - a[:, k] * z[lag + t - 1 - k]
            z[lag + t] = now
    out: Array = angle - z[lag:].T
    return out


def delta(n: Array, error: Array, dt: float, frequencies: Array = FREQUENCIES) -> Complex:
    """Delta of each segment by an ARX(2) from the error to n, delay of one sample.

    Args:
        n: (S, N) what the model leaves.
        error: (S, N).
        dt: s.
        frequencies: (F,) Hz.

    Returns:
        (S, F) complex, degrees per m. An n of zero has none.

    >>> y = np.random.default_rng(0).normal(size=(1, 300))
    >>> float(np.abs(delta(np.zeros((1, 300)), y, 0.1)).max())
    0.0
    """
    begin = round(SETTLE_S / dt)
    n, y = n[:, begin:], error[:, begin:]
    known = np.asarray(np.isfinite(n + y).all(axis=1))
    n, y = np.where(known[:, None], n, 0.0), np.where(known[:, None], y, 0.0)
    N = n.shape[1]
    X = np.stack(
        [-n[:, 1 : N - 1], -n[:, : N - 2], y[:, 1 : N - 1], y[:, : N - 2], np.ones((len(n), N - 2))], axis=1
    )
    H = X @ X.swapaxes(1, 2)
    size = np.sqrt(np.einsum("skk->sk", H))
    size = np.where(size > 0.0, size, 1.0)
    H = H / (size[:, :, None] * size[:, None, :])
    theta = solve(H + _RIDGE * np.eye(5), np.einsum("skt,st->sk", X, n[:, 2:]) / size) / size
    q = np.exp(-2j * np.pi * np.asarray(frequencies) * dt)
    B = theta[:, 2:3] * q + theta[:, 3:4] * q**2
    A = 1.0 + theta[:, :1] * q + theta[:, 1:2] * q**2
    out: Complex = np.where(known[:, None], B / A, NAN)
    return out


def null_band(
    model: Array,
    offset: Array,
    c1: float,
    fits: Fits,
    car: Car,
    angle: Array,
    error: Array,
    dt: float,
    repetitions: int,
    seed: int = 0,
) -> NullBand:
    """Repeat every segment's loop with a driver of ARMAX(2,2,1), fit it again, and take Delta of that.

    Args:
        model: (S, 4) a1, a2, b1, b2 of the repetitions.
        offset: (S,) c0.
        c1: of C.
        fits: ARMAX(2,2,1) of the measured segments.
        car: of the same segments.
        angle: (S, N).
        error: (S, N).
        dt: s.
        repetitions: 20 and more, for a 95 % quantile.
        seed: of the repetitions.
    """
    S = len(angle)
    rng = np.random.default_rng(seed)
    replicates = np.empty((repetitions, S, len(FREQUENCIES)), np.complex64)
    at_once = max(_AT_ONCE // S, 1)
    for first in range(0, repetitions, at_once):
        part = slice(first, min(first + at_once, repetitions))
        k = part.stop - first
        rows = np.tile(np.arange(S), k)
        repeated_car = car._replace(constant=car.constant[rows], sd=car.sd[rows])
        c = np.full(len(rows), c1)
        d, y = repeat(
            model[rows], offset[rows], c, fits.sigma[rows], repeated_car, angle[rows], error[rows], rng
        )
        lost = ~np.isfinite(d).all(axis=1)
        d[lost], y[lost] = angle[rows[lost]], error[rows[lost]]
        again = fit_segments(d, y, start=fits.theta[rows])
        values = delta(left(d, y, again.theta), y, dt)
        values[lost | ~reasonable(again.model)] = NAN
        replicates[part] = values.reshape(k, S, -1)
    # a band from fewer than half of the repetitions is that of the tame ones alone
    enough = np.isfinite(replicates[:, :, 0]).mean(axis=0) > 0.5
    quantile = np.full((S, replicates.shape[2]), NAN)
    if not enough.any():
        none = np.full(replicates.shape[2], NAN)
        return NullBand(quantile, none.astype(complex), np.full((len(none), 2, 2), NAN), NAN, S)
    # i / (n + 1): the share of draws above it is 5 % also of few repetitions
    quantile[enough] = np.nanquantile(np.abs(replicates[:, enough]), LEVEL, axis=0, method="weibull")
    means = np.nanmean(replicates[:, enough], axis=1).astype(complex)
    about = means - means.mean(axis=0)
    parts = np.stack([about.real, about.imag], axis=2)  # (repetitions, F, 2)
    precision = np.linalg.inv(np.einsum("kfi,kfj->fij", parts, parts) / (repetitions - 1))
    distance = np.einsum("kfi,fij,kfj->kf", parts, precision, parts)
    limit = float(np.quantile(distance.max(axis=1), LEVEL, method="weibull"))
    return NullBand(quantile, means.mean(axis=0), precision, limit, int((~enough).sum()))


def excess(measured: Complex, band: NullBand) -> Excess:
    """Compare Delta with its null.

    Args:
        measured: (S, F).
        band: of the same segments.
    """
    used = np.isfinite(band.segment).all(axis=1) & np.isfinite(measured).all(axis=1)
    if not used.any():
        none = np.full(measured.shape[1], NAN)
        return Excess(NAN, none, NAN, none)
    x = measured[used]
    away = x.mean(axis=0) - band.mean
    parts = np.stack([away.real, away.imag], axis=1)
    distance = np.einsum("fi,fij,fj->f", parts, band.precision, parts)
    return Excess(
        float((np.abs(x) > band.segment[used]).mean()),
        distance,
        float((distance > band.limit).mean()),
        np.abs(away),
    )
