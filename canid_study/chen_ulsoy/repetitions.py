"""Repetitions of a driver in his own loop: as one that never changes, and as one that changes as much as he does.

The first give what a constant driver's minute fits show: their bias, their true scatter and how many segments pass the
stationarity test. The second give bias and scatter of the fits of a driver who changes, and what |Delta| is compared with.
Their models are the fitted ones drawn together, so that they scatter as much as the minutes do without sampling; at the
fitted models themselves the repetitions would scatter twice.

Fits of minutes in which a pole comes near a zero have standard errors that no linearization gives, and minutes of little
gain have small ones: weights by each minute's own R_k prefer some models to others, and on simulated drivers of Table 2
took 16 to 37 % off the drawn standard deviations. With the scatter of repetitions 1 to 5 % are off with c1 of 0 and 0.3,
and 1 to 13 % with c1 of -0.3, where sampling is as large as what was drawn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.types import Array
from canid_study.chen_ulsoy import nonlinearity, stationarity
from canid_study.chen_ulsoy.between import component
from canid_study.chen_ulsoy.closed_loop import Car, repeat
from canid_study.chen_ulsoy.segment_fits import Fits, Joint, fit_segments, reasonable

# of a1, a2, b1, b2 and c1 among the parameters of a fit
FIVE = np.array([0, 1, 2, 3, 5])
# share of standardized squares left out before they calibrate a covariance: fits with a pole next to a zero have errors
# that no covariance describes
_TRIM = 0.01
# the first with the scatter of a constant driver, the second with that of the first; a third, and a c1 without its bias,
# came no nearer to drawn drivers
_ROUNDS = 2


class ConstantDriver(NamedTuple):
    """What the driver's loop shows if he never changes."""

    bias: Array  # (5,) mean minute fit minus the truth: a1, a2, b1, b2, c1
    bias_sd: Array  # (5,) its standard error
    sd: Array  # (4,) scatter of minute fits
    sampling: Array  # (4, 4) covariance of minute fits
    spread: Array  # (4, 4) covariance of whitened errors; the identity where the fits' covariances are right
    stationary_angle: float  # share of segments that pass the reverse arrangements test
    stationary_error: float
    stationary_residual: float
    rejected: float  # share of segments with unreasonable poles
    dead_zone: Array  # (3,) mean scores of a dead zone where there is none


def constant_driver(
    joint: Joint, car: Car, angle: Array, error: Array, times: int, seed: int = 0
) -> ConstantDriver | None:
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
    repeated_car = car._replace(constant=car.constant[rows], sd=car.sd[rows])
    model = np.tile(joint.model, (len(rows), 1))
    d, y = repeat(
        model,
        joint.offset[rows],
        np.full(len(rows), joint.theta[-1]),
        joint.sigma[rows],
        repeated_car,
        angle[rows],
        error[rows],
        rng,
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
        np.cov(theta[:, :4].T),
        white.T @ white / len(white),
        float(stationarity.passes(d).mean()),
        float(stationarity.passes(y).mean()),
        float(stationarity.passes(fits.residual).mean()),
        float(1.0 - good.mean()),
        # of `times` drives together: their mean score is sqrt(times) of one drive's
        nonlinearity.scores(fits.take(good), d[good], y[good], nonlinearity.half_widths(error)) / times**0.5,
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


class Sampling(NamedTuple):
    """What the fits of the driver's minutes add to the driver's models."""

    covariance: Array  # (4, 4) that sampling adds to the covariance of the fits
    bias: Array  # (4,) mean of the fits minus that of the models
    bias_sd: Array  # (4,) its standard error
    models: Array  # (S, 4) of repetitions: a1, a2, b1, b2 of each segment
    c1: float
    changing: bool  # do the minutes differ by more than sampling?


def sampling_of(
    fits: Fits,
    joint: Joint,
    constant: ConstantDriver,
    car: Car,
    angle: Array,
    error: Array,
    times: int,
    seed: int = 0,
) -> Sampling:
    """Bias and scatter of the minute fits, at models that scatter as the driver's do.

    Where no parameter's variance between minutes excludes 0 they are those of a constant driver. Else the models are the
    fits drawn together, in some rounds, the first with the scatter of a constant driver.

    Args:
        fits: of the segments.
        joint: of all.
        constant: repetitions of a constant driver.
        car: of the same segments.
        angle: (S, N).
        error: (S, N).
        times: repetitions of all segments, each round.
        seed: of them.
    """
    S = len(angle)
    x, C = fits.model, constant.sampling
    v = np.diag(C)
    if all(component([(x[:, j], np.full(S, v[j]))]).sd.low <= 0.0 for j in range(4)):
        models = np.tile(joint.model, (S, 1))
        return Sampling(C, constant.bias[:4], constant.bias_sd[:4], models, float(joint.theta[-1]), False)
    c1 = float(np.median(fits.theta[:, -1]))
    rng = np.random.default_rng([seed, 2])
    bias = bias_sd = np.zeros(4)
    models = x
    for _ in range(_ROUNDS):
        models = _drawn_together(x, C)
        rows = np.tile(np.arange(S), times)
        W = models[rows]
        repeated_car = car._replace(constant=car.constant[rows], sd=car.sd[rows])
        offset = _offset(models, angle, error)[rows]
        d, y = repeat(
            W, offset, np.full(len(rows), c1), fits.sigma[rows], repeated_car, angle[rows], error[rows], rng
        )
        held = np.isfinite(d).all(axis=1)
        again = fit_segments(d[held], y[held], start=fits.theta[rows[held]])
        good = reasonable(again.model)
        W, away = W[held][good], (again.model - W[held])[good]
        both = np.cov(np.concatenate([W, away], axis=1).T)
        # var(fit) - var(model): the error's own variance, and its correlation with the model
        C = _at_least(both[4:, 4:] + both[:4, 4:] + both[4:, :4], 0.1 * both[4:, 4:])
        bias, bias_sd = away.mean(axis=0), away.std(axis=0, ddof=1) / len(away) ** 0.5
    return Sampling(C, bias, bias_sd, models, c1, True)


def _drawn_together(x: Array, sampling: Array) -> Array:
    """Fits about their mean, scaled to the covariance that is left without sampling; unreasonable ones stay."""
    mean = x.mean(axis=0)
    # in units of the fits' own covariance, where the parameters are alike
    L = np.linalg.cholesky(np.cov(x.T))
    back = np.linalg.inv(L)
    left = np.eye(4) - back @ sampling @ back.T
    values, vectors = np.linalg.eigh(0.5 * (left + left.T))
    root = vectors @ np.diag(np.sqrt(np.clip(values, 0.0, 1.0))) @ vectors.T
    models: Array = mean + (x - mean) @ (L @ root @ back).T
    bad = ~reasonable(models)
    models[bad] = x[bad]
    return models


def _at_least(C: Array, floor: Array) -> Array:
    """A covariance, no smaller than the floor in any direction."""
    L = np.linalg.cholesky(floor)
    back = np.linalg.inv(L)
    values, vectors = np.linalg.eigh(back @ (0.5 * (C + C.T)) @ back.T)
    half = L @ vectors
    out: Array = half @ np.diag(np.maximum(values, 1.0)) @ half.T
    return out


def _offset(models: Array, angle: Array, error: Array) -> Array:
    """c0 with which each model keeps the means of its segment."""
    out: Array = (1.0 + models[:, 0] + models[:, 1]) * angle.mean(axis=1) - (
        models[:, 2] + models[:, 3]
    ) * error.mean(axis=1)
    return out


def offsets(sampling: Sampling, joint: Joint, angle: Array, error: Array) -> Array:
    """c0 (S,) of the repetitions' models."""
    return _offset(sampling.models, angle, error) if sampling.changing else joint.offset
