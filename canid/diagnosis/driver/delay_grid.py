"""Fits of a driver from a grid of delays: the likelihood has a minimum for several.

A few steps from each point of the grid, with gains that suit it, show the minima. Which of them is the lowest shows only
with a noise model of its own: that of a model already fitted favours what is near it.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_model import (
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
# −2 log likelihood within which two fits have reached the same minimum, and minima that are compared
SAME_MINIMUM, MAX_MINIMA = 1.0, 3
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
    apart = [
        one for k, one in enumerate(short) if not k or one.deviance > short[k - 1].deviance + SAME_MINIMUM
    ]
    return [solve(data, model, one.q, without.noise, without.rows, turns=2) for one in apart[:MAX_MINIMA]]


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
