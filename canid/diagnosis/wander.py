"""The headway that a driver wants, wandering: a random walk beside the noise, told by its marginal likelihood.

The wish is straight between knots 30 s apart, its steps are normal with one variance q². Integrated out, the residual's
covariance is that of the noise plus B Σ(q) B′; the best q against q = 0 is the evidence (a variance component, Harville
1977). The noise's colour is fitted again with the wander taken out: before, it holds the wander as an unlikely slow root.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, qr

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import K1, TAU1, THETA1, bound, delayed, lagged
from canid.diagnosis.least_squares import jacobian
from canid.diagnosis.likelihood import Noise, colour, score, whitened
from canid.diagnosis.solved import Solved
from canid.effects.headway_drift import EVERY
from canid.types import Array, Interval

# s per knot; from what no one could see to a wish that is thrown about
STEPS = np.geomspace(0.01, 1.0, 25)
TURNS = 3
# s per knot of a wish that moves briskly: a search begins where it has taken all it can
BRISK = 0.2
# fewer knots than this have no variance to speak of
KNOTS = 6


class Wander(NamedTuple):
    """A wish that wanders."""

    evidence: float  # 2 Δ log likelihood
    sd: Interval  # s, of the wish over the drive
    added: Array  # (n,) output unit, what it does to the output
    wish: Array  # (n,) s, deviation of the desired headway from its mean
    noise: Noise


def shapes(data: DriverData, q: Array) -> Array:
    """What one second of wish at each knot does to the output: (n, knots)."""
    t = data.seen.t
    knots = int(np.ceil(data.seen.drive / EVERY)) + 1
    at = t / EVERY
    columns = np.maximum(0.0, 1.0 - np.abs(at[:, None] - np.arange(knots)[None, :]))
    dt = data.output.dt
    return np.stack(
        [-q[K1] * lagged(delayed(c, float(q[THETA1]), dt), float(q[TAU1]), dt) for c in columns.T], axis=1
    )


def look(data: DriverData, solved: Solved) -> Wander | None:
    """Search a wander in what a model leaves; None: too short, or no answer to headway.

    A slow root of the noise and a wander explain the same residual, and each holds its own once it is there: the search
    begins on both sides.
    """
    B = shapes(data, solved.q)
    knots = B.shape[1]
    if knots < KNOTS or abs(solved.q[K1]) < 1e-3:
        return None
    walk = np.tril(np.ones((knots, knots)))[:, 1:]  # steps -> wish
    shape = B @ walk
    left = np.where(solved.rows, data.output.y - solved.fitted.model, 0.0)
    within = np.where(solved.rows[:, None], shape, 0.0)
    ridge = float(np.var(left[solved.rows])) / BRISK**2 * np.eye(knots - 1)
    away = shape @ np.linalg.solve(within.T @ within + ridge, within.T @ left)
    p = solved.noise.A.size - 1
    quicker = colour(data.output, data.output.y - solved.fitted.model - away, p, solved.noise.size)
    return max(
        (_found(data, solved, shape, walk, noise) for noise in (solved.noise, quicker)),
        key=lambda found: found.evidence,
    )


def _found(data: DriverData, solved: Solved, shape: Array, walk: Array, noise: Noise) -> Wander:
    """Search from one colour of the noise on."""
    plain = _explained(data, solved, shape, solved.noise).without
    best: Wander | None = None
    profile = np.empty(STEPS.size)
    for _ in range(TURNS):
        gram, b, without = _explained(data, solved, shape, noise)
        for k, q in enumerate(STEPS):
            factor = cho_factor(np.eye(len(b)) + q * q * gram)
            won = q * q * float(b @ cho_solve(factor, b))
            profile[k] = without - won + 2 * float(np.log(np.diag(factor[0])).sum())
        k = int(np.argmin(profile))
        variance = float(STEPS[k])
        steps = variance**2 * cho_solve(cho_factor(np.eye(len(b)) + variance**2 * gram), b)
        added, wish = shape @ steps, walk @ steps
        noise = colour(data.output, data.output.y - solved.fitted.model - added, noise.A.size - 1, noise.size)
        evidence = float(plain - profile[k])
        if best is None or evidence > best.evidence:
            inside = STEPS[profile <= profile[k] + 3.84]
            curve = np.interp(data.seen.t, EVERY * np.arange(len(walk)), wish)
            sd = float(np.std(curve))
            # a random walk's spread over the drive is proportional to its step
            told = Interval(sd, float(sd * inside.min() / variance), float(sd * inside.max() / variance))
            added = added - added[solved.rows].mean()
            best = Wander(evidence, told, added, curve - curve.mean(), noise)
    assert best is not None
    return best


class Explained(NamedTuple):
    """What the steps of a wish explain of a residual, the model's own directions taken out."""

    gram: Array  # (k, k)
    b: Array  # (k,)
    without: float  # −2 log likelihood of no step at all


def _explained(data: DriverData, solved: Solved, shape: Array, noise: Noise) -> Explained:
    """Whiten with a colour."""
    scored = score(data.output, solved.rows, noise, solved.fitted.model)
    rows = scored.slope == -1.0
    X = np.where(rows[:, None], whitened(noise, shape), 0.0)
    model, fitted = solved.model, solved.fitted
    function = bound(model, data)
    # the model's directions as this colour weighs them
    at = (fitted.q, fitted.free, model.scale, model.high, fitted.model, scored.slope)
    J = jacobian(data.output, rows, noise, function, *at)
    Q = qr(J, mode="economic")[0]
    e = np.where(rows, scored.e, 0.0)
    e = e - Q @ (Q.T @ e)
    X = X - Q @ (Q.T @ X)
    return Explained(X.T @ X, X.T @ e, 2 * int(rows.sum()) * float(np.log(noise.sd)) + float(e @ e))
