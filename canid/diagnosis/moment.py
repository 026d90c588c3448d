"""The moment at which something changed: a cost with many valleys, looked at everywhere at once.

With all else held the whitened residual is, but for the seconds around the change, the one of "not yet" before it and
the one of "already" after it. Two sums along the drive are the cost of every moment.
"""

from __future__ import annotations

import numpy as np

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import pedal
from canid.diagnosis.likelihood import score
from canid.diagnosis.solved import Solved, solve
from canid.types import Array, Interval

# 2 Δ log likelihood that holds the true moment in 95 % (Hansen 2000, eq. 11 and table 1): a moment has no parabola
FALL = 7.35
# how often the other parameters and the moment are fitted by turns
TURNS = 3
# −2 log likelihood by which another moment must be better
BETTER = 0.5


def of(solved: Solved) -> list[int]:
    """Indices of the parameters that are moments."""
    return [
        k
        for effect, where in zip(solved.model.effects, solved.model.where, strict=True)
        for p, k in zip(effect.parameters, range(where.start, where.stop), strict=True)
        if p.moment
    ]


def costs(data: DriverData, solved: Solved, k: int) -> Array:
    """−2 log likelihood (n,) with the moment at each sample, all else held; up to a constant."""

    def squares(moment: float) -> Array:
        q = solved.q.copy()
        q[k] = moment
        e = score(data.output, solved.rows, solved.noise, pedal(solved.model, data, q)).e
        return np.asarray(e * e)

    far = data.seen.drive + 1e4
    before, after = squares(far), squares(-far)
    out: Array = np.cumsum(before) - before + np.cumsum(after[::-1])[::-1]
    return out


def settled(data: DriverData, solved: Solved) -> Solved:
    """Move every moment to the deepest valley, everything else fitted anew."""
    for k in of(solved):
        for _ in range(TURNS):
            q = solved.q.copy()
            q[k] = float(data.seen.t[int(np.argmin(costs(data, solved, k)))])
            if abs(q[k] - solved.q[k]) <= data.output.dt:
                break
            tried = solve(data, solved.model.effects, q, solved.noise, solved.rows)
            if tried.deviance > solved.deviance - BETTER:
                break
            solved = tried
    return solved


def told(data: DriverData, solved: Solved, k: int, overstated: float) -> Interval:
    """95 % of a moment: from the first to the last that is as likely.

    Args:
        data: what was fitted.
        solved: the fit.
        k: the moment's index.
        overstated: how much faster the likelihood falls than the score's spread allows, at least 1.
    """
    t, cost = data.seen.t, costs(data, solved, k)
    likely = np.flatnonzero(cost - cost.min() <= FALL * overstated)
    at, dt = float(solved.q[k]), data.output.dt
    return Interval(at, min(float(t[likely[0]]) - dt, at), max(float(t[likely[-1]]) + dt, at))
