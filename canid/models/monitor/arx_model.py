"""ARX one-step predictor, fitted by recursive least squares with exponential forgetting over minutes.

y = Σ a y(t−k) + Σ b u(t−k) + c (Ljung 1999, eq. 4.7), forgetting as in eq. 11.4, on the normal equations: they stay
positive definite, and a batch of data is one matrix product. The order is high enough to take up the autocorrelation
of the noise, so that the innovations are white.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.state_constraints import FINITE, NOT_NEGATIVE
from canid.values.types import NAN, Array

# share of a column's sum of squares that is added to it: makes collinear columns solvable, moves no number
RIDGE_SHARE = 1e-7
# an innovation counts for no more than this many standard deviations in the variance: one jolt does not widen it
MAX_INNOVATION_SD = 4.0
# times the root of the mean leverage; a row with more is far from those that were learnt (Belsley, Kuh & Welsch 1980,
# ch. 2, take 2 to 3 times the mean)
USUAL_LEVERAGE_ROOT = 1.7


class State(NamedTuple):
    """The model, and the normal equations that it is the solution of."""

    normal: Annotated[Array, FINITE]  # (m + 1, m + 1) Σ [X y]ᵀ [X y], with forgetting
    rows: Annotated[float, FINITE, NOT_NEGATIVE]  # Σ weights
    theta: Annotated[Array, FINITE]  # (m,); 0 where a column is not fitted
    inverse: Annotated[Array, FINITE]  # (m, m) of Σ XᵀX; 0 where a column is not fitted
    mean: Annotated[Array, FINITE]  # (m,) of the columns
    variance: float  # of the innovations; NaN: not known yet
    predicted_variance: Annotated[float, FINITE, NOT_NEGATIVE]  # of X @ theta


def init(columns: int) -> State:
    """Return an empty model with so many columns, the last one a constant 1."""
    zero = np.zeros((columns + 1, columns + 1))
    return State(zero, 0.0, np.zeros(columns), zero[1:, 1:], np.zeros(columns), NAN, 0.0)


def innovations(state: State, X: Array, y: Array) -> Array:
    """Return the one-step prediction errors of y (n,): (n,)."""
    e: Array = y - X @ state.theta
    return e


def extrapolation(state: State, X: Array) -> Array:
    """Root of the leverage at rows (n, m), as far as it exceeds the usual: (n,), in standard deviations of y.

    It is the model's own standard error, which grows with the distance from the learnt rows. The usual part counts as
    zero: it does not add up over rows.

    Example:
        >>> x = np.column_stack([np.linspace(-1.0, 1.0, 100), np.ones(100)])
        >>> state = learn(init(2), x, x[:, 0], np.arange(2), 1e4)
        >>> np.round(extrapolation(state, np.array([[0.5, 1.0], [4.0, 1.0]])), 1)
        array([0. , 0.5])
    """
    fitted = np.count_nonzero(np.diagonal(state.inverse))
    error = np.sqrt(np.maximum(((X @ state.inverse) * X).sum(axis=1), 0.0))
    excess: Array = np.maximum(error - USUAL_LEVERAGE_ROOT * np.sqrt(fitted / state.rows), 0.0)
    return excess


def expected_variance(state: State, X: Array, noise_scales: bool) -> Array:
    """Return the variance of an innovation at rows (n, m): (n,).

    It includes the model's own error far from the learnt rows; where the noise scales with the response, a response n
    times as large as usual may be n times as noisy.

    Example:
        >>> x = np.column_stack([np.linspace(-1.0, 1.0, 101), np.ones(101)])
        >>> state = learn(init(2), x, x[:, 0], np.arange(2), 1e9)._replace(variance=0.01)
        >>> np.round(expected_variance(state, np.array([[0.1, 1.0], [1.0, 1.0]]), noise_scales=True), 2)
        array([0.01, 0.03])
    """
    scale = np.ones(len(X))
    if noise_scales:
        response = (X - state.mean) @ state.theta
        scale = np.maximum(response * response / max(state.predicted_variance, state.variance), 1.0)
    variance: Array = state.variance * (scale + extrapolation(state, X) ** 2)
    return variance


def gain_uncertainty(state: State, X: Array, gains: Sequence[Sequence[int]]) -> Array:
    """Return how far off the responses to some inputs may be at rows (n, m), given how well their gains are known.

    Args:
        state: with a known variance.
        X: (n, m) columns.
        gains: for each response, the columns whose coefficients add up to its gain.

    Returns:
        (n,) two standard errors, in the unit of y.

    Example:
        >>> x = np.column_stack([np.linspace(-1.0, 1.0, 100), np.ones(100)])
        >>> state = learn(init(2), x, x[:, 0], np.arange(2), 1e4)._replace(variance=1.0)
        >>> np.round(gain_uncertainty(state, np.array([[0.5, 1.0], [4.0, 1.0]]), [[0]]), 1)
        array([0.2, 1.4])
    """
    squares = np.zeros(len(X))
    for gain in map(list, gains):
        response = (X[:, gain] - state.mean[gain]) @ state.theta[gain]
        error = state.variance * float(state.inverse[np.ix_(gain, gain)].sum())
        # a gain that may be zero is not known at all
        squares += response**2 * (error / max(float(state.theta[gain].sum()) ** 2, 1e-6 * error))
    two: Array = 2.0 * np.sqrt(np.maximum(squares, 0.0))
    return two


def learn(state: State, X: Array, y: Array, fitted: npt.NDArray[np.intp], memory_rows: float) -> State:
    """Add rows to the normal equations, and solve them.

    Args:
        state: from `init` or the step before.
        X: (n, m) columns, the last one 1.
        y: (n,) outcomes.
        fitted: (p,) indices of the columns that the model has; of the others only the means are kept.
        memory_rows: rows after which a weight has fallen to 1/e.

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
    forgetting = 1.0 - 1.0 / memory_rows
    both = np.column_stack((X, y))
    normal = state.normal * forgetting**n + both.T @ both
    rows = state.rows * forgetting**n + n
    e = y - X @ state.theta
    theta = np.zeros(len(state.theta))
    gram = normal[np.ix_(fitted, fitted)]
    diagonal = np.arange(len(fitted))
    gram[diagonal, diagonal] *= 1.0 + RIDGE_SHARE
    gram[diagonal, diagonal] += np.finfo(float).tiny ** 0.5
    fitted_inverse = np.linalg.inv(gram)
    theta[fitted] = fitted_inverse @ normal[fitted, -1]
    inverse = np.zeros_like(state.inverse)
    inverse[np.ix_(fitted, fitted)] = fitted_inverse
    if state.variance != state.variance:
        residual = float(normal[-1, -1] - normal[-1, :-1] @ theta)
        variance = residual / (rows - len(fitted)) if rows > 2 * len(fitted) and residual > 0 else NAN
    else:
        share = 1.0 - forgetting**n
        bounded = np.minimum(e * e, MAX_INNOVATION_SD**2 * state.variance)
        variance = (1.0 - share) * state.variance + share * float(bounded.mean())
    mean = normal[-2, :-1] / rows
    square = float(theta @ normal[:-1, :-1] @ theta) / rows
    return State(normal, rows, theta, inverse, mean, variance, max(square - float(mean @ theta) ** 2, 0.0))
