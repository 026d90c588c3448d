"""Repetitions of a driver in his own loop: as one that never changes, and as one that changes as much as he does.

The first give what a constant driver's minute fits show: their bias, their true scatter and how many segments pass the
stationarity test. The second are what |Delta| is compared with: models drawn from the empirical Bayes posterior of each
minute (Morris 1983). At the fitted models themselves the repetitions would scatter twice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.study.chen_ulsoy import between, stationarity
from canid.study.chen_ulsoy.closed_loop import Car, repeat
from canid.study.chen_ulsoy.segment_fits import Fits, Joint, fit_segments, reasonable
from canid.types import Array

# of a1, a2, b1, b2 and c1 among the parameters of a fit
FIVE = np.array([0, 1, 2, 3, 5])
# share of standardized squares left out before they calibrate a covariance: fits with a pole next to a zero have errors
# that no covariance describes
_TRIM = 0.01


class ConstantDriver(NamedTuple):
    """What the driver's loop shows if he never changes."""

    bias: Array  # (5,) mean minute fit minus the truth: a1, a2, b1, b2, c1
    bias_sd: Array  # (5,) its standard error
    sd: Array  # (4,) scatter of minute fits
    spread: Array  # (4, 4) covariance of whitened errors; the identity where the fits' covariances are right
    stationary_angle: float  # share of segments that pass the reverse arrangements test
    stationary_error: float
    stationary_residual: float
    rejected: float  # share of segments with unreasonable poles
    segments: int


def constant_driver(joint: Joint, car: Car, angle: Array, error: Array, times: int, seed: int = 0) -> ConstantDriver | None:
    """Repeat all segments with one and the same model.

    Args:
        joint: the model of all segments.
        car: of the same segments.
        angle: (S, N).
        error: (S, N).
        times: repetitions of all segments.
        seed: of them.

    Returns:
        None where the loop runs away in most of them.
    """
    S = len(angle)
    rng = np.random.default_rng([seed, 1])
    rows = np.tile(np.arange(S), times)
    own = car._replace(constant=car.constant[rows], sd=car.sd[rows])
    model = np.tile(joint.model, (len(rows), 1))
    d, y = repeat(
        model, joint.offset[rows], np.full(len(rows), joint.theta[-1]), joint.sigma[rows], own, angle[rows], error[rows], rng
    )
    held = np.isfinite(d).all(axis=1)
    if held.mean() < 0.5:
        return None
    d, y = d[held], y[held]
    start = np.concatenate([joint.model, [0.0], joint.theta[-1:]])
    fits = fit_segments(d, y, start=start)
    good = reasonable(fits.model)
    theta = fits.theta[good][:, FIVE]
    away = theta - joint.theta
    whitener = np.linalg.inv(np.linalg.cholesky(fits.model_covariance[good]))
    white = np.einsum("kij,kj->ki", whitener, away[:, :4] - away[:, :4].mean(axis=0))
    size = (white**2).sum(axis=1)
    white = white[size <= np.quantile(size, 1.0 - _TRIM)]
    return ConstantDriver(
        away.mean(axis=0),
        away.std(axis=0, ddof=1) / np.sqrt(len(away)),
        theta[:, :4].std(axis=0, ddof=1),
        white.T @ white / len(white),
        float(stationarity.passes(d).mean()),
        float(stationarity.passes(y).mean()),
        float(stationarity.passes(fits.residual).mean()),
        float(1.0 - good.mean()),
        len(d),
    )


def calibrated(covariances: Array, constant: ConstantDriver | None) -> Array:
    """Covariances of fits (S, 4, 4) as the repetitions of a constant driver scatter; never narrower."""
    if constant is None:
        return covariances
    values, vectors = np.linalg.eigh(constant.spread)
    root = vectors @ np.diag(np.sqrt(np.maximum(values, 1.0))) @ vectors.T
    half = np.linalg.cholesky(covariances) @ root
    out: Array = half @ half.swapaxes(1, 2)
    return out


def drawn_models(
    fits: Fits, joint: Joint, constant: ConstantDriver | None, changing: bool, angle: Array, error: Array, times: int, seed: int = 0
) -> tuple[Array, Array, Array]:
    """Models of each segment and repetition for the null band.

    Args:
        fits: of the segments.
        joint: of all.
        constant: its bias is taken off; None: none is known.
        changing: whether the minutes differ by more than sampling; else every repetition has the joint model.
        angle: (S, N) whose mean each model keeps.
        error: (S, N).
        times: repetitions.
        seed: of the draws.

    Returns:
        (times, S, 4) models, (times, S) offsets c0, (times, S) c1.
    """
    S = len(angle)
    theta = np.broadcast_to(joint.theta, (times, S, 5)).copy()
    found = None
    if changing:
        x = fits.theta[:, FIVE] - (0.0 if constant is None else constant.bias)
        R = fits.covariance[:, FIVE[:, None], FIVE[None, :]]
        found = between.covariance([(x, R)])
    if found is not None:
        W = np.linalg.inv(R + found.between)
        gain = found.between @ W
        middle = found.mean + np.einsum("kij,kj->ki", gain, x - found.mean)
        P = found.between - gain @ found.between
        values, vectors = np.linalg.eigh(0.5 * (P + P.swapaxes(1, 2)))
        root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        rng = np.random.default_rng([seed, 2])
        theta = middle + np.einsum("kij,tkj->tki", root, rng.standard_normal((times, S, 5)))
        bad = ~reasonable(theta.reshape(-1, 5)).reshape(times, S) | (np.abs(theta[..., 4]) > 0.95)
        # a draw with an unstable pole: the segment's own fit instead
        theta[bad] = np.broadcast_to(fits.theta[:, FIVE], (times, S, 5))[bad]
    a, b = theta[..., :2], theta[..., 2:4]
    offset = (1.0 + a.sum(axis=2)) * angle.mean(axis=1) - b.sum(axis=2) * error.mean(axis=1)
    return theta[..., :4], offset, theta[..., 4]
