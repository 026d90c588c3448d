"""Change point: the time at which something changed, found by its cost at every sample, which has many local minima.

With all else fixed the whitened residual is, but for the seconds around the change, the one of "not yet" before it and
the one of "already" after it. Two sums along the drive are the cost of every time.
"""

from __future__ import annotations

import numpy as np

from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_model import pedal
from canid.diagnosis.fitting.fitted_model import solve
from canid.diagnosis.fitting.likelihood import score
from canid.types import Array, Interval

# 2 Δ log likelihood within which the true change point lies in 95 % (Hansen 2000, eq. 11 and table 1): its likelihood
# is no parabola
CHANGE_POINT_FALL = 7.35
# how often the other parameters and the change point are fitted in turn
CHANGE_POINT_ALTERNATIONS = 3
# −2 log likelihood by which another time must be better
MIN_DEVIANCE_DROP = 0.5


def of(solved: FittedDriver) -> list[int]:
    """Indices of the parameters that are change points."""
    return [
        k
        for effect, where in zip(solved.model.effects, solved.model.where, strict=True)
        for p, k in zip(effect.parameters, range(where.start, where.stop), strict=True)
        if p.change_point
    ]


def costs(data: DriverData, solved: FittedDriver, k: int) -> Array:
    """−2 log likelihood (n,) with the change point at each sample, all else fixed; up to a constant."""

    def squares(time: float) -> Array:
        q = solved.q.copy()
        q[k] = time
        e = score(data.output, solved.rows, solved.noise, pedal(solved.model, data, q)).e
        return np.asarray(e * e)

    far = data.seen.duration + 1e4
    before, after = squares(far), squares(-far)
    out: Array = np.cumsum(before) - before + np.cumsum(after[::-1])[::-1]
    return out


def refined(data: DriverData, solved: FittedDriver) -> FittedDriver:
    """Move every change point to the deepest minimum, everything else fitted anew."""
    for k in of(solved):
        for _ in range(CHANGE_POINT_ALTERNATIONS):
            q = solved.q.copy()
            q[k] = float(data.seen.t[int(np.argmin(costs(data, solved, k)))])
            if abs(q[k] - solved.q[k]) <= data.output.dt:
                break
            tried = solve(data, solved.model, q, solved.noise, solved.rows)
            if tried.deviance > solved.deviance - MIN_DEVIANCE_DROP:
                break
            solved = tried
    return solved


def interval(data: DriverData, solved: FittedDriver, k: int, variance_inflation: float) -> Interval:
    """95 % interval of a change point: from the first to the last time that is as likely.

    Args:
        data: what was fitted.
        solved: the fit.
        k: the change point's index.
        variance_inflation: how much faster the likelihood falls than the scores' covariance allows, at least 1.
    """
    t, cost = data.seen.t, costs(data, solved, k)
    likely = np.flatnonzero(cost - cost.min() <= CHANGE_POINT_FALL * variance_inflation)
    at, dt = float(solved.q[k]), data.output.dt
    return Interval(at, min(float(t[likely[0]]) - dt, at), max(float(t[likely[-1]]) + dt, at))
