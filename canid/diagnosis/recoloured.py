"""What more columns explain once the noise's colour is fitted anew beside them.

A slow structure that a model lacks is taken for the noise's own slowness, and whitened away with it: held against that
colour, the score of the very columns that explain it is small. So model and colour are fitted by turns, with and without.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import bound
from canid.diagnosis.least_squares import jacobian
from canid.diagnosis.likelihood import Noise, colour, score, whitened
from canid.diagnosis.solved import Solved
from canid.types import Array

# turns of "coefficients given the colour, colour given the coefficients"
TURNS = 4
# samples that the noise is allowed to remember beyond its model: more than its highest order
MEMORY = 30
# of the largest eigenvalue; a direction below it is rounding
RANK = 1e-10


def directions(data: DriverData, solved: Solved) -> Array:
    """Derivatives of the output by the model's free parameters, (n, k), not whitened."""
    n = solved.rows.size
    plain = Noise(np.array([1.0]), 1.0, np.ones(n), np.empty(0))
    fitted, model = solved.fitted, solved.model
    J = jacobian(
        data.output, np.ones(n, dtype=bool), plain, bound(model, data), fitted.q, fitted.free, model.scale,
        model.high, fitted.model, np.ones(n),
    )  # fmt: skip
    length = np.linalg.norm(J, axis=0)
    out: Array = J[:, length > 0] / length[length > 0]
    return out


def remembered(solved: Solved) -> Array:
    """What was new in the residual the samples before, as orthonormal columns (n, MEMORY): a colour of higher order.

    The noise moves the car, and the car what is seen: inputs of long ago hold the noise of long ago. Where the noise
    remembers longer than its model, as a resonance under a sensor's noise does, they seem to be answered.
    """
    e = np.where(solved.fitted.scored.slope == -1.0, solved.fitted.scored.e, 0.0)
    past = np.column_stack([np.r_[np.zeros(k), e[:-k]] for k in range(1, MEMORY + 1)]) * solved.rows[:, None]
    out: Array = qr(past, mode="economic")[0]
    return out


class Beside(NamedTuple):
    """A model with columns beside it."""

    deviance: float  # −2 log likelihood up to a constant that all of these rows share
    change: Array  # (n,) what the columns do to the output


def beside(data: DriverData, solved: Solved, columns: Array, memory: Array) -> Beside:
    """Fit columns (n, k) beside a model, with a colour of the same order.

    The floor is in it as in the model's own fit: what becomes of columns there is no answer.

    Args:
        data: what is explained.
        solved: the model.
        columns: (n, k) output unit, fitted.
        memory: (n, m) from `remembered`, taken out.
    """
    output, rows, p = data.output, solved.rows, solved.noise.A.size - 1
    b, noise, model = np.zeros(columns.shape[1]), solved.noise, solved.fitted.model
    for _ in range(TURNS):
        scored = score(output, rows, noise, model)
        J = np.where(rows[:, None], whitened(noise, columns) * scored.slope[:, None], 0.0)
        J = J - memory @ (memory.T @ J)
        length = np.maximum(np.linalg.norm(J, axis=0), 1e-12)
        J = J / length
        # by the normal equations: a direction that they cannot tell from rounding is left alone
        b = b - np.linalg.lstsq(J.T @ J, J.T @ scored.e, rcond=RANK)[0] / length
        model = solved.fitted.model + columns @ b
        noise = colour(output, output.y - model, p, solved.noise.size)
    scored = score(output, rows, noise, model)
    left = scored.e - memory @ (memory.T @ scored.e)
    return Beside(float(left @ left) + 2.0 * scored.free * float(np.log(noise.sd)), columns @ b)
