"""Random walk of the desired headway: a variance component, estimated by its marginal likelihood (Harville 1977).

The desired headway is linear between knots 30 s apart, its steps are normal with one variance q². Integrated out, the
residual's covariance is that of the noise plus B Σ(q) B′; the best q against q = 0 is the evidence. The noise model is
refitted with the random walk subtracted: before, it contains the walk as an unlikely slow root.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import K1, TAU1, THETA1, delayed, lagged
from canid.models.diagnosis.fitting.fitted_model import problem
from canid.models.diagnosis.fitting.least_squares import derivatives
from canid.models.diagnosis.fitting.likelihood import Noise, fit_noise, score, whitened
from canid.models.effects.effect import KNOT_SPACING_S
from canid.values.findings import Flags
from canid.values.types import Array, Interval

# s per knot, steps of the desired headway that are tried: from invisible ones to erratic ones
STEP_SIZES_S = np.geomspace(0.01, 1.0, 25)
# walk and noise model, fitted in turn
WALK_ALTERNATIONS = 3
# s per knot, step of a brisk walk: one search begins with all that such a walk can take
BRISK_STEP_S = 0.2
# with fewer knots the variance of the steps is not identifiable
MIN_KNOTS = 6

# s of a pause that has knots: those of a night would be thousands, in which nothing is measured
MAX_PAUSE_S = 3600.0


class RandomWalk(NamedTuple):
    """An estimated random walk of the desired headway."""

    evidence: float  # 2 Δ log likelihood
    sd: Interval  # s, of the desired headway over the drive
    added: Array  # (n,) output unit, what it does to the output
    desired_headway: Array  # (n,) s, deviation of the desired headway from its mean
    noise: Noise
    step: float  # s per knot, standard deviation of its steps


def shapes(data: DriverData, q: Array) -> Array:
    """Response of the output to one second of desired headway at each knot: (n, knots)."""
    longer = np.maximum(np.diff(data.seen.t, prepend=data.seen.t[:1]) - MAX_PAUSE_S, 0.0)
    knots = int(np.ceil((data.seen.duration - longer.sum()) / KNOT_SPACING_S)) + 1
    at = (data.seen.t - np.cumsum(longer)) / KNOT_SPACING_S
    columns = np.maximum(0.0, 1.0 - np.abs(at[:, None] - np.arange(knots)[None, :]))
    dt = data.output.dt
    return np.stack(
        [-q[K1] * lagged(delayed(c, float(q[THETA1]), dt), float(q[TAU1]), dt) for c in columns.T], axis=1
    )


def detect(data: DriverData, solved: FittedDriver) -> RandomWalk | None:
    """Estimate a random walk in what a model leaves; None: too short, or no answer to headway.

    A slow root of the noise and a random walk explain the same residual, and each is a local optimum: the search starts
    from both.
    """
    B = shapes(data, solved.q)
    knots = B.shape[1]
    if knots < MIN_KNOTS or abs(solved.q[K1]) < 1e-3:
        return None
    walk = np.tril(np.ones((knots, knots)))[:, 1:]  # steps -> desired headway
    shape = B @ walk
    left = np.where(solved.rows, data.output.y - solved.fitted.model, 0.0)
    within = np.where(solved.rows[:, None], shape, 0.0)
    ridge = float(np.var(left[solved.rows])) / BRISK_STEP_S**2 * np.eye(knots - 1)
    away = shape @ np.linalg.solve(within.T @ within + ridge, within.T @ left)
    p = solved.noise.A.size - 1
    fitted_problem = problem(data, solved.model, solved.noise, solved.rows, solved.fitted.free)
    directions = derivatives(fitted_problem, solved.q, solved.fitted.model)
    left_then = data.output.y - solved.fitted.model - away
    quicker = fit_noise(data.output, left_then, p, solved.noise.size, solved.noise.freedom, solved.rows)
    plain = _explained(data, solved, directions, shape, solved.noise)
    first = plain, _explained(data, solved, directions, shape, quicker)
    return max(
        (
            _found(data, solved, directions, shape, walk, noise, begins, plain.without)
            for noise, begins in zip((solved.noise, quicker), first, strict=True)
        ),
        key=lambda walk: walk.evidence,
    )


def _found(
    data: DriverData,
    solved: FittedDriver,
    directions: Array,
    shape: Array,
    walk: Array,
    noise: Noise,
    explained: Explained,
    plain: float,
) -> RandomWalk:
    """Estimate from one initial noise model, and what it explains; `plain` is −2 log likelihood without any walk."""
    best: RandomWalk | None = None
    for turn in range(WALK_ALTERNATIONS):
        gram, b, without = explained if turn == 0 else _explained(data, solved, directions, shape, noise)
        # by its eigenvalues, all sizes of a step at once
        values, vectors = np.linalg.eigh(gram)
        along, spread = vectors.T @ b, 1.0 + STEP_SIZES_S[:, None] ** 2 * np.maximum(values, 0.0)
        shrunk = STEP_SIZES_S[:, None] ** 2 * along / spread
        profile = without - shrunk @ along + np.log(spread).sum(axis=1)
        k = int(np.argmin(profile))
        variance, steps = float(STEP_SIZES_S[k]), vectors @ shrunk[k]
        added, headway = shape @ steps, walk @ steps
        noise = fit_noise(
            data.output,
            data.output.y - solved.fitted.model - added,
            noise.A.size - 1,
            noise.size,
            noise.freedom,
            solved.rows,
        )
        evidence = float(plain - profile[k])
        if best is None or evidence > best.evidence:
            inside = STEP_SIZES_S[profile <= profile[k] + CHI_SQUARED_QUANTILE]
            curve = np.interp(data.seen.t, KNOT_SPACING_S * np.arange(len(walk)), headway)
            sd = float(np.std(curve))
            # the standard deviation of a random walk over the drive is proportional to its step
            interval = Interval(sd, float(sd * inside.min() / variance), float(sd * inside.max() / variance))
            added = added - added[solved.rows].mean()
            best = RandomWalk(evidence, interval, added, curve - curve.mean(), noise, variance)
    assert best is not None
    return best


class Explained(NamedTuple):
    """Normal equations of the steps for a residual, the model's own directions projected out."""

    gram: Array  # (k, k)
    b: Array  # (k,)
    without: float  # −2 log likelihood of no step at all


def scores_of_walk(data: DriverData, solved: FittedDriver, walk: RandomWalk, rows: Flags) -> Array:
    """What a filtered random walk adds to the log density of each sample, (n,) nats (Schweppe 1965).

    Args:
        data: what is explained.
        solved: the model with the walk taken out of the output.
        walk: the walk; the size of its steps and the noise next to it are used, its path is not.
        rows: (n,) samples that count.
    """
    B = shapes(data, solved.q)
    knots = B.shape[1]
    shape = B @ np.tril(np.ones((knots, knots)))[:, 1:] * walk.step
    left = data.output.y - solved.fitted.model
    # a linear filter: Gaussian innovations, of the standard deviation that they have
    noise = walk.noise._replace(sd=walk.noise.sd * walk.noise.deviation, freedom=math.inf)
    plain = fit_noise(data.output, left, noise.A.size - 1, noise.size, rows=solved.rows)
    free = rows & ~data.output.hidden
    X, e, e0 = whitened(noise, shape), whitened(noise, left), whitened(plain, left)
    # recursive Bayesian regression of the steps, each normal with variance 1
    mean, P = np.zeros(knots - 1), np.eye(knots - 1)
    out = np.zeros(e.size)
    level = math.log(plain.sd / noise.sd)
    for t in np.flatnonzero(free):
        x = X[t]
        Px = P @ x
        spread = 1.0 + float(x @ Px)
        error = float(e[t] - x @ mean)
        out[t] = 0.5 * (e0[t] * e0[t] - error * error / spread - math.log(spread)) + level
        gain = Px / spread
        mean = mean + gain * error
        P = P - np.outer(gain, Px)
    return out


def _explained(
    data: DriverData, solved: FittedDriver, directions: Array, shape: Array, noise: Noise
) -> Explained:
    """Normal equations under a noise model; `directions` (n, k) are the derivatives of the model."""
    scored = score(data.output, solved.rows, noise, solved.fitted.model)
    rows = scored.slope == -1.0
    X = whitened(noise, shape) * rows[:, None]
    # the model's directions as this noise model weighs them
    Q = qr(whitened(noise, directions) * np.where(rows, scored.slope, 0.0)[:, None], mode="economic")[0]
    e = np.where(rows, scored.e, 0.0)
    along, taken = Q.T @ e, Q.T @ X
    without = float(scored.loss[rows].sum()) - float(along @ along)
    sd = 2 * int(rows.sum()) * float(np.log(noise.sd))
    return Explained(X.T @ X - taken.T @ taken, X.T @ e - taken.T @ along, sd + without)
