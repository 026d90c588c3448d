"""Fits of a driver from a grid of delays: the likelihood has a minimum for several.

A few steps from each point of the grid, with gains that suit it, show the minima. Which of them is the lowest shows only
with a noise model of its own: that of a model already fitted favours what is near it.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_model import (
    BASE,
    K1,
    K2,
    OFFSET,
    TAU1,
    TAU2,
    THETA1,
    THETA2,
    DriverModel,
    responses,
)
from canid.diagnosis.driver.recent_values import RecentValues
from canid.diagnosis.fitting.candidates import Guess
from canid.diagnosis.fitting.fitted_model import FittedModel, solve
from canid.diagnosis.fitting.least_squares import ROUGH_TOLERANCE
from canid.diagnosis.fitting.likelihood import whitened
from canid.types import Array

# s, delays of the grid, and steps from each
GRID_THETA_S, GRID_TAU_S = (0.3, 0.7, 1.1, 1.5), (0.2, 0.8)
GRID_ITERATIONS = 6
# s of lag and dead time of the response to range rate, and share of its gain by which other gains differ, within which two
# fits are in one minimum. Their likelihoods say less: on one measured drive the lowest minimum was 15 above the others by
# the noise model without the effect, and 33 below them by its own
SAME_DELAY_S, SAME_GAIN = 0.2, 0.25
# minima that are compared
MAX_MINIMA = 3
# of the largest eigenvalue; a direction below it is rounding
RANK_TOLERANCE = 1e-12
# of a whitened column; a shorter one is 0
MIN_LENGTH = 1e-100


def minima(
    model: DriverModel, data: DriverData, without: FittedModel[DriverModel], q: Array
) -> list[FittedModel[DriverModel]]:
    """Fits of a model from the grid, those that have reached different minima.

    Args:
        model: what is fitted.
        data: the driver's columns.
        without: a model already fitted, whose noise model the first steps use.
        q: of the model; its delays and gains are replaced.
    """
    short, recent = [], RecentValues()
    for theta, tau in product(GRID_THETA_S, GRID_TAU_S):
        guess = q.copy()
        guess[[TAU1, TAU2]], guess[[THETA1, THETA2]] = tau, theta
        guess = regained(model, data, without, guess, recent).q
        few = solve(
            data, model, guess, without.noise, without.rows, 1, None, GRID_ITERATIONS, ROUGH_TOLERANCE
        )
        short.append(few)
    short.sort(key=lambda one: one.deviance)
    apart: list[FittedModel[DriverModel]] = []
    for one in short:
        if not any(same_minimum(one.q, other.q) for other in apart):
            apart.append(one)
    return [solve(data, model, one.q, without.noise, without.rows, turns=2) for one in apart[:MAX_MINIMA]]


def same_minimum(one: Array, other: Array) -> bool:
    """Whether two fits differ little in the delay of the response to range rate and in what is added to it.

    Args:
        one: (p,) parameters of a model.
        other: (p,) of the same model.

    Example:
        >>> q = np.zeros(11)
        >>> q[[K2, TAU2, THETA2, 10]] = 0.4, 0.2, 0.9, 0.3
        >>> p = q.copy()
        >>> p[[TAU2, THETA2]] = 0.5, 0.62
        >>> same_minimum(q, p)
        True
        >>> p[10] = 0.0
        >>> same_minimum(q, p)
        False
    """
    delay = abs(one[TAU2] + one[THETA2] - other[TAU2] - other[THETA2])
    added = np.abs(one[len(BASE) :] - other[len(BASE) :])
    return bool(delay < SAME_DELAY_S and (added <= SAME_GAIN * max(abs(one[K2]), abs(other[K2]))).all())


def regained(
    model: DriverModel,
    data: DriverData,
    without: FittedModel[DriverModel],
    q: Array,
    recent: RecentValues | None = None,
) -> Guess:
    """Fit both gains, and the offset where it is free, by linear least squares, everything else fixed."""
    of, rows = responses(model, data, q, recent), without.fitted.scored.slope == -1.0
    level = 1.0 if OFFSET in model.free() else 0.0
    columns = [np.full_like(of.first, level), of.first, of.second, data.output.y - of.extra]
    white = whitened(without.noise, np.stack(columns).T)[rows]
    X, y, before = white[:, :3], white[:, 3], without.fitted.scored.e[rows]
    length = np.maximum(np.linalg.norm(X, axis=0), MIN_LENGTH)
    gram = X.T @ X / np.outer(length, length)
    gains = np.linalg.lstsq(gram, X.T @ y / length, rcond=RANK_TOLERANCE)[0] / length
    left = y - X @ gains
    q = q.copy()
    q[[OFFSET, K1, K2]] = np.clip(gains, model.low[[OFFSET, K1, K2]], model.high[[OFFSET, K1, K2]])
    return Guess(q, max(float(before @ before - left @ left), 0.0))
