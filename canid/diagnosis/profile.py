"""How far a parameter may move until the likelihood has really fallen: intervals of fits that are no parabola.

A dead zone's width, a threshold, the split of a delay: the likelihood falls slowly on one side and fast on the other, and
the curvature at its top tells neither. Each end is moved, all other parameters fitted anew, until the fall is what the
interval allows (the profile likelihood; Venzon & Moolgavkar 1988), as often as the score really spreads.
"""

from __future__ import annotations

import numpy as np

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.solved import Solved, solve
from canid.types import Interval

# 2 log likelihood at the ends of a 95 % interval
FALL = 3.84
# ends are moved at most so often, and by no more than this factor each time
MOVES, FARTHEST = 3, 3.0
# of FALL, within which an end is where it belongs
NEAR = 0.25


def widened(data: DriverData, solved: Solved, k: int, told: Interval, overstated: float) -> Interval:
    """Move both ends of an interval to where the likelihood has fallen enough; never inwards.

    Args:
        data: what was fitted.
        solved: the best fit.
        k: index of the parameter.
        told: what the curvature says.
        overstated: how much faster the likelihood falls than the score's spread allows, at least 1.
    """
    value = float(solved.q[k])
    return Interval(
        told.value,
        min(_end(data, solved, k, value, told.low, float(solved.model.low[k]), overstated), told.low),
        max(_end(data, solved, k, value, told.high, float(solved.model.high[k]), overstated), told.high),
    )


def _end(
    data: DriverData, solved: Solved, k: int, value: float, end: float, bound: float, overstated: float
) -> float:
    free = tuple(j for j in solved.fitted.free if j != k)
    q = solved.q.copy()
    for _ in range(MOVES):
        away = end - value
        if abs(away) < 1e-9 or not np.isfinite(away):
            return end
        q[k] = end
        there = solve(data, solved.model.effects, q, solved.noise, solved.rows, turns=1, free=free)
        fallen = max(there.deviance - solved.deviance, 0.0) / overstated
        if fallen >= FALL * (1 - NEAR) or end == bound:
            return end
        further = value + away * min(float(np.sqrt(FALL / max(fallen, 1e-3))), FARTHEST)
        end = max(further, bound) if away < 0 else min(further, bound)
        q = there.q.copy()
    return end
