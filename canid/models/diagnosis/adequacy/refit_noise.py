"""Gain of extra columns when the noise model is refitted together with them.

A slow structure that a model lacks is absorbed by a slow noise model and whitened away: under that noise model the
score of the very columns that explain it is small. So columns and noise model are fitted in turn, with and
without them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.fitting.fitted_model import FittedModel, M, problem
from canid.models.diagnosis.fitting.least_squares import derivatives
from canid.models.diagnosis.fitting.likelihood import fit_noise, score, whitened
from canid.models.diagnosis.fitting.model import Columns
from canid.values.types import Array

# of "coefficients given the noise model, noise model given the coefficients"
NOISE_ALTERNATIONS = 4
# samples of memory granted to the noise beyond its model: more than its highest order
MEMORY_SAMPLES = 30
# of the largest eigenvalue; a direction below it is rounding
RANK_TOLERANCE = 1e-10


def directions(data: Columns, solved: FittedModel[M]) -> Array:
    """Derivatives of the output by the model's free parameters, (n, k), not whitened."""
    fitted_problem = problem(data, solved.model, solved.noise, solved.rows, solved.fitted.free)
    J = derivatives(fitted_problem, solved.q, solved.fitted.model)
    length = np.linalg.norm(J, axis=0)
    out: Array = J[:, length > 0] / length[length > 0]
    return out


def noise_memory(solved: FittedModel[M]) -> Array:
    """Past innovations as orthonormal columns (n, at most MEMORY_SAMPLES): noise of a higher order.

    The noise moves the car, and the car what is seen: inputs of long ago hold the noise of long ago. Where the noise
    remembers longer than its model, as a resonance under a sensor's noise does, they seem to be answered.
    """
    e = np.where(solved.fitted.scored.slope == -1.0, solved.fitted.scored.e, 0.0)
    past = (
        np.column_stack([np.r_[np.zeros(k), e[:-k]] for k in range(1, MEMORY_SAMPLES + 1)])
        * solved.rows[:, None]
    )
    square, turn = np.linalg.eigh(past.T @ past)
    kept = square > RANK_TOLERANCE * square[-1]
    out: Array = past @ (turn[:, kept] / np.sqrt(square[kept]))
    return out


class Refit(NamedTuple):
    """A model with extra columns."""

    deviance: float  # −2 log likelihood up to a constant that all of these rows share
    change: Array  # (n,) what the columns do to the output


def refit(data: Columns, solved: FittedModel[M], columns: Array, memory: Array) -> Refit:
    """Fit extra columns (n, k) to what a model leaves, with a noise model of the same order.

    Samples at the floor are treated as in the model's own fit.

    Args:
        data: what is explained.
        solved: the model.
        columns: (n, k) output unit, fitted.
        memory: (n, m) from `noise_memory`, taken out.
    """
    output, rows, p = data.output, solved.rows, solved.noise.A.size - 1
    b, noise, model = np.zeros(columns.shape[1]), solved.noise, solved.fitted.model
    for _ in range(NOISE_ALTERNATIONS):
        scored = score(output, rows, noise, model)
        J = np.where(rows[:, None], whitened(noise, columns) * scored.slope[:, None], 0.0)
        J = J - memory @ (memory.T @ J)
        length = np.maximum(np.linalg.norm(J, axis=0), 1e-12)
        J = J / length
        # by the normal equations: a direction within rounding is left alone
        b = b - np.linalg.lstsq(J.T @ J, J.T @ scored.e, rcond=RANK_TOLERANCE)[0] / length
        model = solved.fitted.model + columns @ b
        noise = fit_noise(output, output.y - model, p, solved.noise.size, solved.noise.freedom)
    scored = score(output, rows, noise, model)
    remembered = memory.T @ scored.e
    cost = scored.cost - float(remembered @ remembered)
    return Refit(cost + 2.0 * scored.free * float(np.log(noise.sd)), columns @ b)
