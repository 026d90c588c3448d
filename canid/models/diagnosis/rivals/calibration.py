"""Calibration of a car-following model: least squares of the gap in closed loop, from several starts.

The gap is the measure of performance (Punzo & Montanino 2016: its error holds the speed's). A Latin hypercube of
parameters is simulated at once; trust-region least squares (scipy) begins from the best few.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc
from scipy.stats import t as student

from canid.mathematics.identification.confidence import MISS
from canid.models.diagnosis.rivals.rival_model import RivalModel
from canid.models.diagnosis.rivals.rival_simulation import Leads, simulate
from canid.values.types import Array, Interval

# parameter vectors that are screened, and how many of them begin a fit
SCREENED, STARTS = 96, 3
# evaluations of one fit; of a unit range, step of the derivatives; relative change at which a fit ends
MAX_STEPS, DERIVATIVE_STEP, TOLERANCE = 20, 1e-4, 1e-4
# of a unit range: nearer to its end a parameter is not identified
AT_BOUND = 1e-3


class Calibrated(NamedTuple):
    """A calibrated model, on the unit cube of its parameters."""

    x: Array  # (k,)
    cost: float  # Σ gap error², m²
    jacobian: Array  # (rows, k) m per unit
    left: Array  # (rows,) m
    stretch: Array  # (rows,) its number


def calibrate(model: RivalModel, stretches: Leads, starts: tuple[Array, ...] = ()) -> Calibrated:
    """Fit a model to the gap.

    Args:
        model: which one.
        stretches: the stretches to fit.
        starts: (k,) each, on the unit cube; (): screened ones.
    """
    fits = [_fit(model, stretches, x) for x in starts or _screened(model, stretches)]
    return min(fits, key=lambda fit: fit.cost)


def intervals(model: RivalModel, calibrated: Calibrated) -> dict[str, Interval]:
    """95 % intervals by the jackknife over stretches, linearised (CR3, MacKinnon & White 1985).

    Errors of one stretch are correlated. A parameter that is not identified, as in `covariance`, has its range as interval.
    """
    m = np.unique(calibrated.stretch).size
    sd = np.sqrt(np.diagonal(covariance(calibrated)))
    wide = float(student.isf(MISS / 2, max(m - 1, 1))) * sd
    value, low, high = (
        model.physical(np.clip(x, 0.0, 1.0)[:, None])[:, 0]
        for x in (calibrated.x, calibrated.x - wide, calibrated.x + wide)
    )
    return {
        parameter.name: Interval(float(value[k]), float(low[k]), float(high[k]))
        for k, parameter in enumerate(model.parameters)
    }


def covariance(calibrated: Calibrated) -> Array:
    """Covariance of the parameters on the unit cube, (k, k), by the jackknife over stretches (CR3).

    A parameter at the end of its range, or that moves nothing, is not identified: its variance is infinite, its covariances
    are 0.
    """
    free = (
        (calibrated.x > AT_BOUND) & (calibrated.x < 1 - AT_BOUND) & np.any(calibrated.jacobian != 0.0, axis=0)
    )
    J = calibrated.jacobian[:, free]
    numbers = np.unique(calibrated.stretch)
    m = numbers.size
    shifts = []
    for k in numbers:
        here = calibrated.stretch == k
        others = J[~here].T @ J[~here]
        shifts.append(
            np.linalg.pinv(others, rcond=1e-10, hermitian=True) @ (J[here].T @ calibrated.left[here])
        )
    out = np.diag(np.where(free, 0.0, np.inf))
    rows = np.array(shifts)
    out[np.ix_(free, free)] = (m - 1) / m * rows.T @ rows
    return out


def _screened(model: RivalModel, stretches: Leads) -> tuple[Array, ...]:
    # the same log gives the same answer
    x = qmc.LatinHypercube(len(model.parameters), rng=np.random.default_rng(0)).random(SCREENED)
    cost = np.sum(_left(model, x.T, stretches) ** 2, axis=0)
    return tuple(x[np.argsort(cost)[:STARTS]])


def _left(model: RivalModel, x: Array, stretches: Leads) -> Array:
    """Errors of the gap, (rows, p), m."""
    gap, _ = simulate(model, model.physical(x), stretches)
    out: Array = np.moveaxis(gap - stretches.gap[:, None, :], 1, 2)[stretches.inside]
    return out


def _fit(model: RivalModel, stretches: Leads, start: Array) -> Calibrated:
    k = start.size
    latest: list[Array] = []

    def errors(x: Array) -> Array:
        # derivatives cost next to nothing along with the value: numpy's overhead is that of one call
        step = np.where(x < 0.5, DERIVATIVE_STEP, -DERIVATIVE_STEP)
        left = _left(model, np.concatenate([x[:, None], x[:, None] + np.diag(step)], axis=1), stretches)
        latest[:] = [x.copy(), (left[:, 1:] - left[:, :1]) / step]
        out: Array = left[:, 0]
        return out

    def jacobian(x: Array) -> Array:
        if not np.array_equal(latest[0], x):
            errors(x)
        return latest[1]

    solution = least_squares(
        errors,
        np.clip(start, AT_BOUND, 1 - AT_BOUND),
        jacobian,
        bounds=(np.zeros(k), np.ones(k)),
        max_nfev=MAX_STEPS,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
    )
    number = np.broadcast_to(np.arange(stretches.inside.shape[1]), stretches.inside.shape)[stretches.inside]
    return Calibrated(solution.x, 2 * float(solution.cost), solution.jac, solution.fun, number.astype(float))
