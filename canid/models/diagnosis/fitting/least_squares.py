"""Least squares of whitened residuals within bounds: small problems, many of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from canid.mathematics.identification.levenberg_marquardt import Damping, Local, minimise
from canid.models.diagnosis.fitting.likelihood import Noise, Output, Scored, score, whitened
from canid.values.findings import Flags
from canid.values.types import Array

# of a parameter's scale; a difference smaller than this drowns in rounding, a larger one bends with the model
DIFFERENCE_STEP = 1e-4
ITERATIONS = 25
# of the largest eigenvalue of the noise's past; a direction below it is rounding
MEMORY_RANK = 1e-12
# relative fall of the cost at which a fit has ended; and one whose noise model is fitted again afterwards, whose minimum is
# only one of several, or that predicts held-out data: a thousandth of the tests' bounds, and of the parameters a small part
# of their standard deviations
TOLERANCE, ROUGH_TOLERANCE = 1e-6, 1e-5
DAMPING = Damping(
    1e-3,
    up=6.0,
    down=5.0,
    least=1e-8,
    tries=8,
    iterations=ITERATIONS,
    tolerance=TOLERANCE,
    growth=2.0,
    predicted=True,
)

P = TypeVar("P")
Model = Callable[[Array], Array]  # parameters (k,) -> (n,)


class Problem(NamedTuple):
    """What is fitted to what."""

    output: Output  # what is explained
    rows: Flags  # (n,) samples that count
    noise: Noise  # held
    model: Model
    free: tuple[int, ...]  # indices of the parameters that are fitted
    low: Array  # (k,) bounds
    high: Array
    scale: Array  # (k,) typical size of each parameter
    ties: Array | None = None  # (m, k) prior knowledge: each row times q is normal with mean 0 and variance 1


class Fitted(NamedTuple):
    """A fit."""

    q: Array  # (k,) all parameters
    free: tuple[int, ...]  # those that were fitted
    model: Array  # (n,)
    scored: Scored
    jacobian: Array  # (n, free) d whitened residual / d free parameter; 0 where a sample does not count
    ties: Array  # (m, free) of what is known beforehand
    tied: float  # −2 log of its density at q
    memory: Array = np.empty(
        (0, 0)
    )  # (n, p) as the jacobian, by the noise's coefficients; (0, 0): these are held


def jacobian(problem: Problem, q: Array, at: Array, slope: Array) -> Array:
    """Derivatives of the whitened residuals (n, free), by forward differences away from the bounds.

    Args:
        problem: the problem.
        q: (k,) parameters.
        at: (n,) the model's output there.
        slope: (n,) d whitened residual / d whitened model.
    """
    out = whitened(problem.noise, derivatives(problem, q, at))
    out *= slope[:, None]
    # along the columns, which are what is contiguous
    out.T[:, ~problem.rows] = 0.0
    return out


def derivatives(problem: Problem, q: Array, at: Array) -> Array:
    """Derivatives of the model's output (n, free); arguments as in `jacobian`."""
    out = np.empty((len(problem.free), problem.output.y.size))
    for row, k in zip(out, problem.free, strict=True):
        h = DIFFERENCE_STEP * problem.scale[k]
        moved = q.copy()
        moved[k] += -h if q[k] + h > problem.high[k] else h
        np.subtract(problem.model(moved), at, out=row)
        row /= moved[k] - q[k]
    return out.T


def fit(problem: Problem, q: Array, iterations: int = ITERATIONS, tolerance: float = TOLERANCE) -> Fitted:
    """Fit the free parameters.

    Args:
        problem: the problem.
        q: (k,) initial guess.
        iterations: at most so many steps.
        tolerance: relative fall of the cost at which it ends.

    Returns:
        the best that was found: never worse than the initial guess.
    """
    J = np.empty((0, 0))

    def point(q: Array) -> _Point:
        at = problem.model(q)
        scored = score(problem.output, problem.rows, problem.noise, at)
        return _Point(q, at, scored, scored.cost + tied(problem, q))

    def near(here: _Point) -> Local[_Point] | None:
        nonlocal J
        J = jacobian(problem, here.q, here.model, here.scored.slope)
        return local(problem, here.q, J, here.scored.e, point)

    damping = DAMPING._replace(iterations=iterations, tolerance=tolerance)
    minimum = minimise(point(np.clip(q, problem.low, problem.high)), lambda at: at.cost, near, damping)
    q, at, scored, _ = minimum.point
    if minimum.exhausted:
        J = jacobian(problem, q, at, scored.slope)
    return Fitted(q, problem.free, at, scored, J, free_ties(problem), tied(problem, q))


def tied(problem: Problem, q: Array) -> float:
    """−2 log density of what is known beforehand, at q (k,)."""
    return 0.0 if problem.ties is None else float(np.sum((problem.ties @ q) ** 2))


def free_ties(problem: Problem) -> Array:
    """What is known beforehand of the free parameters, (m, free)."""
    ties = np.zeros((0, problem.low.size)) if problem.ties is None else problem.ties
    out: Array = ties[:, list(problem.free)]
    return out


def without_memory(J: Array, memory: Array) -> Array:
    """Derivatives of the whitened residuals (n, k), less what the noise's coefficients (n, p) can take up."""
    if not memory.size:
        return J
    out: Array = J - memory @ np.linalg.lstsq(memory.T @ memory, memory.T @ J, rcond=MEMORY_RANK)[0]
    return out


def local(problem: Problem, q: Array, J: Array, e: Array, point: Callable[[Array], P]) -> Local[P] | None:
    """The neighbourhood of a point; None: every parameter stands at its bound and wants beyond it.

    Args:
        problem: the problem.
        q: (k,) parameters.
        J: (n, free) derivatives of the whitened residuals.
        e: (n,) whitened residuals.
        point: makes a point of parameters (k,).
    """
    index, low, high = list(problem.free), problem.low, problem.high
    ties = free_ties(problem)
    gradient = J.T @ e + (0.0 if problem.ties is None else ties.T @ (problem.ties @ q))
    # a parameter that stands at its bound and wants beyond it does not move
    stuck = ((q[index] <= low[index]) & (gradient > 0)) | ((q[index] >= high[index]) & (gradient < 0))
    moving = np.flatnonzero(~stuck)
    if not moving.size:
        return None
    H = (J.T @ J + ties.T @ ties)[np.ix_(moving, moving)]
    where = [index[m] for m in moving]

    def move(step: Array) -> P:
        trial = q.copy()
        trial[where] = np.clip(q[where] + step, low[where], high[where])
        return point(trial)

    return Local(gradient[moving], H, np.diag(H) + 1e-12 * (np.trace(H) + 1.0), move)


class _Point(NamedTuple):
    q: Array  # (k,)
    model: Array  # (n,)
    scored: Scored
    cost: float
