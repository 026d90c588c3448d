"""Profile-likelihood intervals (Venzon & Moolgavkar 1988), for likelihoods that are no parabola.

A dead zone's width, a threshold, the split of a delay: the likelihood falls slowly on one side and fast on the other, and
the curvature at its top shows neither. Each end is moved, all other parameters fitted anew, until the fall is what the
interval allows, times the variance inflation of the score.
"""

from __future__ import annotations

import numpy as np

from canid.diagnosis.fitting.fitted_model import FittedModel, M, solve
from canid.diagnosis.fitting.model import Columns
from canid.identification.confidence import CHI_SQUARED_QUANTILE
from canid.types import Interval

# ends are moved at most so often, and by no more than this factor each time
MAX_MOVES, MAX_FACTOR = 3, 3.0
# of the fall, within which an end is where it belongs
TOLERANCE = 0.25


def widened(
    data: Columns, solved: FittedModel[M], k: int, narrow: Interval, variance_inflation: float
) -> Interval:
    """Move both ends of an interval to where the likelihood has fallen enough; never inwards.

    Args:
        data: what was fitted.
        solved: the best fit.
        k: index of the parameter.
        narrow: the interval by the curvature.
        variance_inflation: how much faster the likelihood falls than the scores' covariance allows, at least 1.
    """
    value = float(solved.q[k])
    return Interval(
        narrow.value,
        min(
            _end(data, solved, k, value, narrow.low, float(solved.model.low[k]), variance_inflation),
            narrow.low,
        ),
        max(
            _end(data, solved, k, value, narrow.high, float(solved.model.high[k]), variance_inflation),
            narrow.high,
        ),
    )


def _end(
    data: Columns,
    solved: FittedModel[M],
    k: int,
    value: float,
    end: float,
    bound: float,
    variance_inflation: float,
) -> float:
    free = tuple(j for j in solved.fitted.free if j != k)
    q = solved.q.copy()
    for _ in range(MAX_MOVES):
        away = end - value
        if abs(away) < 1e-9 or not np.isfinite(away):
            return end
        q[k] = end
        there = solve(data, solved.model, q, solved.noise, solved.rows, turns=1, free=free)
        fallen = max(there.deviance - solved.deviance, 0.0) / variance_inflation
        if fallen >= CHI_SQUARED_QUANTILE * (1 - TOLERANCE) or end == bound:
            return end
        further = value + away * min(float(np.sqrt(CHI_SQUARED_QUANTILE / max(fallen, 1e-3))), MAX_FACTOR)
        end = max(further, bound) if away < 0 else min(further, bound)
        q = there.q.copy()
    return end
