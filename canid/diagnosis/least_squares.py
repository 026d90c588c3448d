"""Levenberg–Marquardt on whitened residuals, within bounds: small problems, many of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from canid.diagnosis.likelihood import Noise, Output, Scored, score, whitened
from canid.findings import Flags
from canid.types import Array

# of a parameter's scale; a difference smaller than this drowns in rounding, a larger one bends with the model
STEP = 1e-4
# relative fall of the cost at which a fit has ended
ENOUGH = 1e-6
ITERATIONS = 25

Model = Callable[[Array], Array]  # parameters (k,) -> (n,)


class Fitted(NamedTuple):
    """A fit."""

    q: Array  # (k,) all parameters
    free: tuple[int, ...]  # those that were fitted
    model: Array  # (n,)
    scored: Scored
    jacobian: Array  # (n, free) d whitened residual / d free parameter; 0 where a sample does not count
    ties: Array  # (m, free) of what is known beforehand
    tied: float  # −2 log of its density at q


def jacobian(
    output: Output,
    rows: Flags,
    noise: Noise,
    model: Model,
    q: Array,
    free: tuple[int, ...],
    scale: Array,
    high: Array,
    at: Array,
    slope: Array,
) -> Array:
    """Derivatives of the whitened residuals, by forward differences away from the bounds."""
    out = np.empty((output.y.size, len(free)))
    for column, k in enumerate(free):
        h = STEP * scale[k]
        moved = q.copy()
        moved[k] += -h if q[k] + h > high[k] else h
        out[:, column] = (model(moved) - at) / (moved[k] - q[k])
    out = whitened(noise, out) * slope[:, None]
    out[~rows] = 0.0
    return out


def fit(
    output: Output,
    rows: Flags,
    noise: Noise,
    model: Model,
    q: Array,
    free: tuple[int, ...],
    low: Array,
    high: Array,
    scale: Array,
    iterations: int = ITERATIONS,
    ties: Array | None = None,
) -> Fitted:
    """Fit the free parameters.

    Args:
        output: what is explained.
        rows: (n,) samples that count.
        noise: colour and size, held.
        model: parameters -> (n,).
        q: (k,) where to begin.
        free: indices of those that are fitted.
        low: (k,) bounds.
        high: (k,) bounds.
        scale: (k,) typical size of each.
        iterations: at most so many steps.
        ties: (m, k) what is known beforehand: each row times q is normal with mean 0 and variance 1.

    Returns:
        the best that was found: never worse than where it began.
    """
    index = list(free)
    ties = np.zeros((0, q.size)) if ties is None else ties
    own = ties[:, index]
    q = np.clip(q, low, high)
    at = model(q)
    now = score(output, rows, noise, at)
    J = jacobian(output, rows, noise, model, q, free, scale, high, at, now.slope)
    damping = 1e-3
    for _ in range(iterations):
        away = ties @ q
        gradient, curvature = J.T @ now.e + own.T @ away, J.T @ J + own.T @ own
        # a parameter that stands at its bound and wants beyond it does not move
        stuck = ((q[index] <= low[index]) & (gradient > 0)) | ((q[index] >= high[index]) & (gradient < 0))
        moving = np.flatnonzero(~stuck)
        if not moving.size:
            break
        before = cost = now.cost + float(away @ away)
        for _ in range(8):
            H = curvature[np.ix_(moving, moving)]
            D = np.diag(H) + 1e-12 * (np.trace(H) + 1.0)
            step = np.linalg.solve(H + np.diag(damping * D + 1e-300), -gradient[moving])
            tried = q.copy()
            where = [index[m] for m in moving]
            tried[where] = np.clip(q[where] + step, low[where], high[where])
            model_there = model(tried)
            there = score(output, rows, noise, model_there)
            cost_there = there.cost + float(np.sum((ties @ tried) ** 2))
            if cost_there < cost:
                q, at, now, cost, damping = tried, model_there, there, cost_there, max(damping / 5, 1e-8)
                break
            damping *= 6
        if before - cost <= ENOUGH * before:
            break
        J = jacobian(output, rows, noise, model, q, free, scale, high, at, now.slope)
    else:
        J = jacobian(output, rows, noise, model, q, free, scale, high, at, now.slope)
    return Fitted(q, free, at, now, J, own, float(np.sum((ties @ q) ** 2)))
