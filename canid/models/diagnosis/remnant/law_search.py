"""Which effects the law of the innovations needs: backward elimination from the law with all of them.

Each effect is judged next to all others: a Gaussian likelihood takes any heavy tail for a scale that varies, and any
varying scale for a heavy tail. Innovations are martingale differences, so likelihood ratios need no correction for
autocorrelation, and 1/ν at its bound makes the one for heavy tails smaller than chi-squared says (Chernoff 1954).

The law is Student's t with a log-linear scale (Lange, Little & Taylor 1989; Harvey 1976): x_t = sd exp(γ·F_t) z_t, z
Student's t with ν degrees of freedom, Gaussian as the limit. In `mathematics.identification.innovation_law` ν is on a grid,
which is what a live estimator can afford; likelihood ratios and intervals need the maximum. It is fitted as 1/ν: the
Gaussian lies at a finite distance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import digamma, gammaln

from canid.mathematics.identification.innovation_law import Law
from canid.models.diagnosis.fitting.search import RIVAL
from canid.models.diagnosis.fitting.uncertainty import needed
from canid.models.diagnosis.remnant.innovations import Innovations
from canid.models.effects.effect import Effect
from canid.values.findings import Flags
from canid.values.types import Array

# of 1/ν: from 200 degrees of freedom, which no drive distinguishes from a Gaussian, to 2.08, where the variance is about
# to become infinite
MIN_INVERSE, MAX_INVERSE = 0.005, 0.48
# of a slope per standard deviation of its feature: a factor of 20 from one standard deviation below to one above
MAX_SLOPE = 1.5
# log of the scale, at most, from its value at the mean: a factor of 5 either way, as the noise model's own; a law that was
# fitted to other stretches must not be sure of a scale that it has never seen
MAX_LOG_SCALE = 1.6
# 1/ν from which the fit starts: between people and a Gaussian
START_INVERSE = 0.1


class FittedLaw(NamedTuple):
    """A law and its likelihood."""

    law: Law
    log_likelihood: float


def fit(x: Array, F: Array, *, heavy: bool, inverse: float | None = None) -> FittedLaw:
    """Fit the law.

    Args:
        x: (n,) innovations.
        F: (k, n) features of log scale.
        heavy: Student's t; otherwise Gaussian.
        inverse: 1/ν, where it is held.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> F = rng.normal(size=(1, 6000))
        >>> found = fit(np.exp(0.4 * F[0]) * rng.standard_t(4, 6000), F, heavy=True).law
        >>> bool(3.5 < found.freedom < 4.6), bool(0.36 < found.slopes[0] < 0.44)
        (True, True)
    """
    k, n = F.shape
    free = heavy and inverse is None
    held = inverse if heavy and inverse is not None else 0.0

    def cost(theta: Array) -> tuple[float, Array]:
        value, gradient = _value(x, F, theta[: k + 1], float(theta[-1]) if free else held, free)
        return -value / n, -gradient / n

    start = np.r_[math.log(max(float(np.sqrt(np.mean(x * x))), 1e-300)), np.zeros(k)]
    bounds: list[tuple[float | None, float | None]] = [(None, None), *[(-MAX_SLOPE, MAX_SLOPE)] * k]
    if free:
        start, bounds = np.r_[start, START_INVERSE], [*bounds, (MIN_INVERSE, MAX_INVERSE)]
    minimum = minimize(
        cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-11, "gtol": 1e-7}
    )
    theta = np.asarray(minimum.x, dtype=np.float64)
    last = float(theta[-1]) if free else held
    law = Law(1.0 / last if last > 0 else math.inf, math.exp(theta[0]), theta[1 : k + 1])
    return FittedLaw(law, -float(minimum.fun) * n)


def _value(x: Array, F: Array, theta: Array, inverse: float, free: bool) -> tuple[float, Array]:
    """Log likelihood and its gradient by (log sd, slopes, 1/ν)."""
    relative = theta[1:] @ F
    log_scale = theta[0] + np.clip(relative, -MAX_LOG_SCALE, MAX_LOG_SCALE)
    z2 = (x * np.exp(-log_scale)) ** 2
    score = scores(z2, inverse)
    gradient = [score.sum(), *(F @ np.where(np.abs(relative) < MAX_LOG_SCALE, score, 0.0))]
    value = float(_log_density(z2, log_scale, inverse).sum())
    if free:
        nu, n = 1.0 / inverse, len(x)
        by_nu = n * (float(digamma(0.5 * (nu + 1)) - digamma(0.5 * nu)) - 1.0 / nu)
        by_nu += float((nu + 1.0) / nu * (z2 / (nu + z2)).sum() - np.log1p(z2 * inverse).sum())
        gradient.append(-nu * nu * 0.5 * by_nu)
    return value, np.array(gradient)


def scores(z2: Array, inverse: float) -> Array:
    """Derivative of the log density by log scale (n,), of squared standardised innovations; `inverse` is 1/ν.

    Example:
        >>> scores(np.array([0.0, 4.0]), 0.0)
        array([-1.,  3.])
    """
    return np.asarray((1.0 + inverse) * z2 / (1.0 + inverse * z2) - 1.0)


def slope(law: Law, x: Array) -> Array:
    """Derivative of the log density by the mean (n,), of innovations (n,) at relative scale 1.

    Example:
        >>> slope(Law(math.inf, 2.0, np.zeros(0)), np.array([3.0]))
        array([0.75])
    """
    z = x / law.sd
    return np.asarray((1.0 + 1.0 / law.freedom) * z / (1.0 + z * z / law.freedom) / law.sd)


def log_density(law: Law, x: Array, F: Array) -> Array:
    """Log density of innovations (n,), with features (k, n).

    Example:
        >>> float(log_density(Law(math.inf, 1.0, np.zeros(0)), np.zeros(1), np.zeros((0, 1)))[0].round(3))
        -0.919
    """
    log_scale = math.log(law.sd) + np.clip(law.slopes @ F, -MAX_LOG_SCALE, MAX_LOG_SCALE)
    return _log_density((x * np.exp(-log_scale)) ** 2, log_scale, 1.0 / law.freedom)


def _log_density(z2: Array, log_scale: Array, inverse: float) -> Array:
    if inverse <= 0.0:
        return np.asarray(-0.5 * z2 - log_scale - 0.5 * math.log(2 * math.pi))
    nu = 1.0 / inverse
    constant = float(gammaln(0.5 * (nu + 1)) - gammaln(0.5 * nu)) - 0.5 * math.log(nu * math.pi)
    return np.asarray(constant - log_scale - 0.5 * (nu + 1.0) * np.log1p(z2 * inverse))


class Judged(NamedTuple):
    """One effect next to those that were in the law with it."""

    effect: Effect
    evidence: float  # 2 Δ log likelihood over the law without it
    needed: float


def features_of(innovations: Innovations, effects: Sequence[Effect], rows: Flags) -> Array:
    """Features of the scale (k, rows): those of the effects in their order, then what every law has."""
    of_effects = [
        innovations.features[feature]
        for effect in effects
        if effect.remnant
        for feature in effect.remnant.scale
    ]
    return np.vstack([*of_effects, innovations.present])[:, rows]


def fitted(
    innovations: Innovations, effects: Sequence[Effect], rows: Flags, inverse: float | None = None
) -> FittedLaw:
    """Fit the law with some effects to some rows."""
    heavy = any(effect.remnant is not None and effect.remnant.heavy_tailed for effect in effects)
    return fit(innovations.x[rows], features_of(innovations, effects, rows), heavy=heavy, inverse=inverse)


def without(effects: Sequence[Effect], gone: Effect) -> tuple[Effect, ...]:
    """All effects but one."""
    return tuple(effect for effect in effects if effect is not gone)


def eliminated(
    innovations: Innovations, effects: tuple[Effect, ...], tried: int
) -> tuple[tuple[Effect, ...], list[Judged]]:
    """Drop the effects that the law does not need, the weakest first.

    Args:
        innovations: the innovations.
        effects: all that may be in the law.
        tried: candidates of the whole diagnosis of the driver; the threshold accounts for all.

    Returns:
        the effects that stay, and each effect as it was judged last.
    """
    judged: dict[str, Judged] = {}
    while effects:
        most = fitted(innovations, effects, innovations.rows).log_likelihood
        for effect in effects:
            lost = most - fitted(innovations, without(effects, effect), innovations.rows).log_likelihood
            judged[effect.id] = Judged(effect, max(2.0 * lost, 0.0), needed(len(effect.parameters), tried))
        weakest = min(
            (judged[effect.id] for effect in effects),
            key=lambda verdict: verdict.evidence - verdict.needed,
        )
        if weakest.evidence > weakest.needed:
            break
        effects = without(effects, weakest.effect)
    return effects, list(judged.values())


def rivals(
    innovations: Innovations, kept: tuple[Effect, ...], replaced: Effect, others: Sequence[Effect]
) -> tuple[str, ...]:
    """Effects that explain the innovations as well in the place of one that was kept."""
    most = fitted(innovations, kept, innovations.rows).log_likelihood
    rest = without(kept, replaced)
    return tuple(
        other.id
        for other in others
        if other not in kept
        and 2.0 * (most - fitted(innovations, (*rest, other), innovations.rows).log_likelihood) < RIVAL
    )
