"""The model that is held against the present: a regression of what comes next, with a memory of minutes.

An autoregression with exogenous inputs, y = Σ a y(t−k) + Σ b u(t−k) + c (Ljung 1999, eq. 4.7), fitted by least squares
with exponential forgetting (eq. 11.4) on its normal equations: they lose no definiteness, and a second of data is one
product of matrices. The order is high enough to take up the noise's colour, so that what is left is new.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.types import NAN, Array

# share of a column's own square that is added to it: keeps collinear columns solvable, moves no number
_RIDGE = 1e-7
# an innovation counts for no more than this many standard deviations in the variance: one jolt is no new scatter
_JOLT = 4.0
# times the root of the mean leverage; a row with more is far from those that were learnt (Belsley, Kuh & Welsch 1980,
# ch. 2, take 2 to 3 times the mean)
_USUAL = 1.7


class State(NamedTuple):
    """What the past told."""

    normal: Array  # (m + 1, m + 1) Σ [X y]ᵀ [X y], forgetting
    rows: float  # Σ weights
    theta: Array  # (m,); 0 where a column is not fitted
    spread: Array  # (m, m) inverse of Σ XᵀX; 0 where a column is not fitted
    mean: Array  # (m,) of the columns
    variance: float  # of the innovations; NaN: not known yet
    foretold: float  # variance of X @ theta


def init(columns: int) -> State:
    """Know nothing of a model with so many columns, the last one a constant 1."""
    nothing = np.zeros((columns + 1, columns + 1))
    return State(nothing, 0.0, np.zeros(columns), nothing[1:, 1:], np.zeros(columns), NAN, 0.0)


def innovations(state: State, X: Array, y: Array) -> Array:
    """Return what the past did not tell of y (n,): (n,)."""
    new: Array = y - X @ state.theta
    return new


def far(state: State, X: Array) -> Array:
    """How far off the model itself may be at rows (n, m), in standard deviations of an innovation: (n,).

    The square root of the leverage: the model's own standard error, which grows with the distance from what it has
    learnt. As much as is usual where it has learnt counts as nothing: it does not add up over rows.

    Example:
        >>> x = np.column_stack([np.linspace(-1.0, 1.0, 100), np.ones(100)])
        >>> state = learn(init(2), x, x[:, 0], np.arange(2), 1e4)
        >>> np.round(far(state, np.array([[0.5, 1.0], [4.0, 1.0]])), 1)
        array([0. , 0.5])
    """
    known = np.count_nonzero(np.diagonal(state.spread))
    error = np.sqrt(np.maximum(((X @ state.spread) * X).sum(axis=1), 0.0))
    beyond: Array = np.maximum(error - _USUAL * np.sqrt(known / state.rows), 0.0)
    return beyond


def expected(state: State, X: Array, grows: bool) -> Array:
    """Variance that an innovation may have at rows (n, m): (n,).

    A model far from what it has learnt errs by itself; where noise grows, an answer n times as large as usual may be n
    times as noisy.

    Example:
        >>> x = np.column_stack([np.linspace(-1.0, 1.0, 101), np.ones(101)])
        >>> state = learn(init(2), x, x[:, 0], np.arange(2), 1e9)._replace(variance=0.01)
        >>> np.round(expected(state, np.array([[0.1, 1.0], [1.0, 1.0]]), grows=True), 2)
        array([0.01, 0.03])
    """
    times = np.ones(len(X))
    if grows:
        away = (X - state.mean) @ state.theta
        times = np.maximum(away * away / max(state.foretold, state.variance), 1.0)
    variance: Array = state.variance * (times + far(state, X) ** 2)
    return variance


def doubt(state: State, X: Array, gains: Sequence[Sequence[int]]) -> Array:
    """How far off the answers to some inputs may be at rows (n, m), since their gains are known only so well: (n,).

    Args:
        state: with a known variance.
        X: (n, m) columns.
        gains: for each answer, the columns whose coefficients add up to its gain.

    Returns:
        Two standard errors, in the outcome's unit.

    Example:
        >>> x = np.column_stack([np.linspace(-1.0, 1.0, 100), np.ones(100)])
        >>> state = learn(init(2), x, x[:, 0], np.arange(2), 1e4)._replace(variance=1.0)
        >>> np.round(doubt(state, np.array([[0.5, 1.0], [4.0, 1.0]]), [[0]]), 1)
        array([0.2, 1.4])
    """
    squares = np.zeros(len(X))
    for gain in map(list, gains):
        answered = (X[:, gain] - state.mean[gain]) @ state.theta[gain]
        error = state.variance * float(state.spread[np.ix_(gain, gain)].sum())
        # a gain that may be nothing is not known at all
        squares += answered**2 * (error / max(float(state.theta[gain].sum()) ** 2, 1e-6 * error))
    two: Array = 2.0 * np.sqrt(np.maximum(squares, 0.0))
    return two


def learn(state: State, X: Array, y: Array, fitted: npt.NDArray[np.intp], memory: float) -> State:
    """Take rows in.

    Args:
        state: from `init` or the step before.
        X: (n, m) columns, the last one 1.
        y: (n,) what came.
        fitted: (p,) indices of the columns that the model has; the others only have their means kept.
        memory: rows after which a weight has fallen to 1/e.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> X = np.column_stack([rng.standard_normal(500), np.ones(500)])
        >>> state = learn(init(2), X, 3.0 * X[:, 0] + 1.0 + 0.1 * rng.standard_normal(500), np.arange(2), 1e4)
        >>> np.round(state.theta, 1)
        array([3., 1.])
    """
    n = len(y)
    if not n:
        return state
    kept = 1.0 - 1.0 / memory
    both = np.column_stack((X, y))
    normal = state.normal * kept**n + both.T @ both
    rows = state.rows * kept**n + n
    e = y - X @ state.theta
    theta = np.zeros(len(state.theta))
    gram = normal[np.ix_(fitted, fitted)]
    diagonal = np.arange(len(fitted))
    gram[diagonal, diagonal] *= 1.0 + _RIDGE
    gram[diagonal, diagonal] += np.finfo(float).tiny ** 0.5
    inverse = np.linalg.inv(gram)
    theta[fitted] = inverse @ normal[fitted, -1]
    spread = np.zeros_like(state.spread)
    spread[np.ix_(fitted, fitted)] = inverse
    if state.variance != state.variance:
        left = float(normal[-1, -1] - normal[-1, :-1] @ theta)
        variance = left / (rows - len(fitted)) if rows > 2 * len(fitted) and left > 0 else NAN
    else:
        share = 1.0 - kept**n
        bounded = np.minimum(e * e, _JOLT**2 * state.variance)
        variance = (1.0 - share) * state.variance + share * float(bounded.mean())
    mean = normal[-2, :-1] / rows
    square = float(theta @ normal[:-1, :-1] @ theta) / rows
    return State(normal, rows, theta, spread, mean, variance, max(square - float(mean @ theta) ** 2, 0.0))
