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
from canid.diagnosis.driver_model import K1, TAU1, THETA1, delayed, lagged
from canid.diagnosis.likelihood import Noise, colour, score, whitened
from canid.diagnosis.solved import Solved
from canid.effects.headway_drift import EVERY
from canid.types import Array, Interval

# s per knot; from what no one could see to a wish that is thrown about
STEPS = np.geomspace(0.01, 1.0, 25)
TURNS = 3
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
    """Search a wander in what a model leaves; None: too short, or no answer to headway."""
    B = shapes(data, solved.q)
    n, knots = B.shape
    if knots < KNOTS or abs(solved.q[K1]) < 1e-3:
        return None
    walk = np.tril(np.ones((knots, knots)))[:, 1:]  # steps -> wish
    shape = B @ walk
    noise, added, wish = solved.noise, np.zeros(n), np.zeros(knots)
    best, variance, plain = np.inf, 0.0, np.nan
    profile = np.empty(STEPS.size)
    for _ in range(TURNS):
        scored = score(data.output, solved.rows, noise, solved.fitted.model)
        rows = scored.slope == -1.0
        X = np.where(rows[:, None], whitened(noise, shape), 0.0)
        J = np.where(rows[:, None], solved.fitted.jacobian, 0.0)
        Q = qr(J, mode="economic")[0]
        e = np.where(rows, scored.e, 0.0)
        e = e - Q @ (Q.T @ e)
        X = X - Q @ (Q.T @ X)
        gram, b = X.T @ X, X.T @ e
        free = int(rows.sum())
        if plain != plain:
            plain = 2 * free * float(np.log(noise.sd)) + float(e @ e)
        for k, q in enumerate(STEPS):
            factor = cho_factor(np.eye(knots - 1) + q * q * gram)
            won = q * q * float(b @ cho_solve(factor, b))
            profile[k] = (
                2 * free * np.log(noise.sd) + float(e @ e) - won + 2 * float(np.log(np.diag(factor[0])).sum())
            )
        k = int(np.argmin(profile))
        best, variance = float(profile[k]), float(STEPS[k])
        steps = variance**2 * cho_solve(cho_factor(np.eye(knots - 1) + variance**2 * gram), b)
        added, wish = shape @ steps, walk @ steps
        noise = colour(data.output, data.output.y - solved.fitted.model - added, noise.A.size - 1, noise.size)
    inside = STEPS[profile <= best + 3.84]
    curve = np.interp(data.seen.t, EVERY * np.arange(knots), wish)
    sd = float(np.std(curve))
    # a random walk's spread over the drive is proportional to its step
    told = Interval(sd, float(sd * inside.min() / variance), float(sd * inside.max() / variance))
    return Wander(float(plain - best), told, added - added[solved.rows].mean(), curve - curve.mean(), noise)
