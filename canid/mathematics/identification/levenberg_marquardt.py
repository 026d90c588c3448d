"""Levenberg–Marquardt: Gauss–Newton steps, damped in proportion to the curvature's diagonal (Marquardt 1963).

A problem says what a point is, what it costs, what its neighbourhood looks like, and which steps are allowed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from canid.values.types import Array

P = TypeVar("P")


class Damping(NamedTuple):
    """How the damping follows success, and when a descent ends."""

    initial: float
    up: float  # factor after a step that was refused or cost more
    down: float  # divisor after one that was taken
    least: float
    tries: int  # at one point, until it counts as the minimum
    iterations: int  # steps that are taken at most
    tolerance: float  # relative fall of the cost at which the descent has ended
    growth: float = 1.0  # of `up` with each further step that is refused at the same point (Nielsen 1999)
    predicted: bool = (
        False  # does the descent end as well where a step is refused that would gain no more than that?
    )


class Local(NamedTuple, Generic[P]):
    """The neighbourhood of a point, of half the cost."""

    gradient: Array  # (k,)
    curvature: Array  # (k, k)
    damped: Array  # (k,) what the damping multiplies, positive
    move: Callable[[Array], P | None]  # step (k,) -> a point; None: not allowed


def gauss_newton(
    psi: Array, residual: Array, root: Array | None, move: Callable[[Array], P | None]
) -> Local[P] | None:
    """The neighbourhood of a point of a sum of squared residuals; None where a parameter moves nothing.

    Args:
        psi: (k, n) negative gradient of the residuals.
        residual: (n,).
        root: (n,) of the weight of each square; None: one.
        move: step (k,) -> a point; None: not allowed.
    """
    if root is not None:
        psi, residual = root * psi, root * residual
    curvature = psi @ psi.T
    size = np.diag(curvature)
    if not (np.isfinite(size).all() and (size > 0.0).all()):
        return None
    return Local(-(psi @ residual), curvature, size, move)


class Minimum(NamedTuple, Generic[P]):
    """Where a descent ended."""

    point: P
    exhausted: bool  # by its number of iterations


def minimise(
    point: P,
    cost: Callable[[P], float],
    local: Callable[[P], Local[P] | None],
    damping: Damping,
) -> Minimum[P]:
    """Descend; never to a higher cost than that of the first point.

    Args:
        point: where to begin.
        cost: of a point.
        local: its neighbourhood; None: nothing can move.
        damping: pace and end.

    Raises:
        LinAlgError: a curvature that no damping makes regular.

    >>> how = Damping(1e-3, 6.0, 5.0, 1e-8, 8, 25, 1e-12)
    >>> r = lambda x: np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
    >>> J = lambda x: np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])
    >>> near = lambda x: Local(J(x).T @ r(x), J(x).T @ J(x), np.diag(J(x).T @ J(x)) + 1e-9, lambda step: x + step)
    >>> minimise(np.array([-1.2, 1.0]), lambda x: float(r(x) @ r(x)), near, how).point.round(3)  # Rosenbrock's valley
    array([1., 1.])
    """
    mu = damping.initial
    for _ in range(damping.iterations):
        here = local(point)
        if here is None:
            return Minimum(point, False)
        before, up = cost(point), damping.up
        for _ in range(damping.tries):
            matrix = here.curvature + np.diag(mu * here.damped)
            step: Array = np.asarray(np.linalg.solve(matrix, -here.gradient), np.float64)
            trial = here.move(step)
            if trial is not None and cost(trial) <= before:
                break
            fall = -float(step @ (2.0 * here.gradient + here.curvature @ step))
            if damping.predicted and fall <= damping.tolerance * before:
                return Minimum(point, False)
            mu, up = mu * up, up * damping.growth
        else:
            return Minimum(point, False)
        point, mu = trial, max(mu / damping.down, damping.least)
        if before - cost(point) <= damping.tolerance * before:
            return Minimum(point, False)
    return Minimum(point, True)
