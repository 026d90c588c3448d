"""Descent within the walls of a Box-Jenkins model: B of one sign, a pole that decays without changing sign, stable noise.

What a step would take across a wall ends on it, and a parameter on a wall that its gradient presses against is held there
while the others move (active set with projection, Bertsekas 1982). A step that is refused for one parameter's wall would
hold all the others as well.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax import polynomial
from canid.mathematics.identification.armax.prediction_errors import (
    BoxJenkinsOrders,
    Point,
    Rows,
    at_point,
    gradient,
    split,
)
from canid.mathematics.identification.levenberg_marquardt import Damping, Local, gauss_newton, minimise
from canid.values.types import Array

DAMPING = Damping(1e-3, up=8.0, down=8.0, least=1e-10, tries=8, iterations=40, tolerance=1e-8)

# A dead time that is tried need not be fitted to the last digit: six steps show whether it is better.
TRIAL = DAMPING._replace(iterations=6, tolerance=1e-4)

# Of a model for each of many lags that are weighed by their likelihoods: to a hundredth of a nat.
GIVEN_LAG = DAMPING._replace(iterations=20, tolerance=1e-6)

# s; longest lag of a driver: a pole beyond is another offset
MAX_LAG_S = 3.0
# of the zeros of C and D: noise that remembers for longer is not distinguishable from a drifting offset
MAX_C_ZERO, MAX_D_ZERO = 0.995, 0.999
# share of the sum of B below which a coefficient is at its wall
AT_WALL = 1e-9
# of each coefficient of B, in the output's unit by the input's, in place of zero
NO_ANSWER = 1e-9


def descend(
    theta: Array, data: Rows, dt: float, free: npt.NDArray[np.bool_], damping: Damping = DAMPING
) -> Point | None:
    """Minimise the squared prediction errors within the walls; None: a curvature that nothing makes regular.

    Args:
        theta: (n,) where to begin; what is beyond a wall is put on it.
        data: rows at their stride.
        dt: s.
        free: (n,) which parameters move.
        damping: pace and end.
    """
    o, m = data.orders, len(data.u)
    longest = float(np.exp(-dt / MAX_LAG_S))

    def local(at: Point) -> Local[Point] | None:
        psi = gradient(at, data)
        down = psi @ (at.e if data.root is None else data.root * data.root * at.e)
        moving = free & ~held(at.theta, down, o, m, longest)

        def move(step: Array) -> Point | None:
            trial = at.theta.copy()
            trial[moving] += step
            trial = np.where(free, within(trial, o, m, longest), trial)
            return at_point(trial, data) if np.isfinite(trial).all() else None

        return gauss_newton(psi[moving], at.e, data.root, move)

    try:
        begin = np.where(free, within(theta, o, m, longest), theta)
        return minimise(at_point(begin, data), lambda at: at.cost, local, damping).point
    except np.linalg.LinAlgError:
        return None


def within(theta: Array, o: BoxJenkinsOrders, m: int, longest: float) -> Array:
    """Put what is beyond a wall on it.

    Args:
        theta: (n,) parameters.
        o: orders.
        m: inputs.
        longest: pole of the longest lag.

    >>> within(np.array([3.0, -1.0, 0.2, 0.0, -1.5]), BoxJenkinsOrders(2, 1, 0, 1), 1, 0.9)
    array([ 3.   ,  0.   ,  0.   ,  0.   , -0.999])
    """
    out = theta.copy()
    B, F, offset, c, d = split(out, o, m)
    # coefficients of B join the dead time between samples: of one sign; a pole moves nothing where all of them are zero
    sign = np.where(B.sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    B = sign * np.maximum(sign * B, 0.0)
    B = np.where(np.abs(B).sum(axis=1, keepdims=True) > NO_ANSWER, B, sign * NO_ANSWER)
    # a driver's answer decays without changing sign
    if o.nf:
        F[:, 0] = np.clip(F[:, 0], -longest, 0.0)
        F = np.array([polynomial.project(f, longest) for f in F]) if o.nf > 1 else F
    noise = polynomial.project(c, MAX_C_ZERO), polynomial.project(d, MAX_D_ZERO)
    return np.concatenate([np.concatenate([B, F], axis=1).ravel(), [offset], *noise])


def held(theta: Array, down: Array, o: BoxJenkinsOrders, m: int, longest: float) -> npt.NDArray[np.bool_]:
    """(n,) which parameters are on a wall that the way down (n,) presses them against."""
    out = np.zeros(len(theta), bool)
    B, F, *_ = split(theta, o, m)
    way = down[: m * (o.nb + o.nf)].reshape(m, -1)
    on_wall = out[: m * (o.nb + o.nf)].reshape(m, -1)
    sign = np.where(B.sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    # from no answer both signs are open
    some = ~no_answer(B)[:, None]
    on_wall[:, : o.nb] = (sign * B <= 0.0) & (sign * way[:, : o.nb] <= 0.0) & some
    if o.nf:
        pole, to = F[:, 0], way[:, o.nb]
        on_wall[:, o.nb] = ((pole >= 0.0) & (to >= 0.0)) | ((pole <= -longest) & (to <= 0.0))
    return out


def no_answer(B: Array) -> npt.NDArray[np.bool_]:
    """(m,) which inputs have none, from B (m, nb)."""
    out: npt.NDArray[np.bool_] = np.abs(B).sum(axis=1) <= 2.0 * B.shape[1] * NO_ANSWER
    return out


def at_delay_wall(theta: Array, o: BoxJenkinsOrders, m: int) -> tuple[int, ...]:
    """Per input, towards which delay its B is pressed: -1 earlier, 1 later, 0 not on a wall.

    >>> at_delay_wall(np.array([0.0, 1.0, -0.5, 2.0, 1.0, -0.5, 0.0]), BoxJenkinsOrders(2, 1, 0, 0), 2)
    (1, 0)
    """
    B, *_ = split(theta, o, m)
    share = np.abs(B) / np.maximum(np.abs(B).sum(axis=1, keepdims=True), 1e-300)
    return tuple(
        0 if len(row) < 2 else (1 if row[0] <= AT_WALL else -1 if row[-1] <= AT_WALL else 0) for row in share
    )


def at_pole_wall(theta: Array, o: BoxJenkinsOrders, m: int, dt: float) -> tuple[bool, ...]:
    """Per input, whether its first pole is at an end of its range, or moves nothing.

    >>> at_pole_wall(np.array([1.0, 1.0, 0.0, 2.0, 1.0, -0.5, 0.0]), BoxJenkinsOrders(2, 1, 0, 0), 2, 0.1)
    (True, False)
    """
    B, F, *_ = split(theta, o, m)
    longest = float(np.exp(-dt / MAX_LAG_S))
    if not o.nf:
        return (False,) * m
    return tuple(
        bool(none or f[0] >= 0.0 or f[0] <= -longest) for none, f in zip(no_answer(B), F, strict=True)
    )
