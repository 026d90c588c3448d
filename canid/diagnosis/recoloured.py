"""What more columns explain once the noise's colour is fitted anew beside them.

A slow structure that a model lacks is taken for the noise's own slowness, and whitened away with it: held against that
colour, the score of the very columns that explain it is small. So model and colour are fitted by turns, with and without.
"""

from __future__ import annotations

import numpy as np

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import bound
from canid.diagnosis.least_squares import jacobian
from canid.diagnosis.likelihood import Noise, colour, score, whitened
from canid.diagnosis.solved import Solved
from canid.types import Array

# turns of "coefficients given the colour, colour given the coefficients"
TURNS = 4
# of the largest singular value; a direction below it is rounding
RANK = 1e-6


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


def deviance(data: DriverData, solved: Solved, columns: Array) -> float:
    """−2 log likelihood of a model plus columns (n, k), with a colour of the same order.

    The floor is in it as in the model's own fit: what becomes of columns there is no answer.
    """
    output, rows, p = data.output, solved.rows, solved.noise.A.size - 1
    b, noise, model = np.zeros(columns.shape[1]), solved.noise, solved.fitted.model
    for _ in range(TURNS):
        scored = score(output, rows, noise, model)
        J = np.where(rows[:, None], whitened(noise, columns) * scored.slope[:, None], 0.0)
        length = np.maximum(np.linalg.norm(J, axis=0), 1e-12)
        b = b - np.linalg.lstsq(J / length, scored.e, rcond=RANK)[0] / length
        model = solved.fitted.model + columns @ b
        noise = colour(output, output.y - model, p, solved.noise.size)
    scored = score(output, rows, noise, model)
    return scored.cost + 2.0 * scored.free * float(np.log(noise.sd))
