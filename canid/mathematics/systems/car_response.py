"""The car's response to its pedal, from the drive: accel = strength / (1 + lag s) [pedal] - damping (speed - mean) + c.

Least squares of strength, damping, offset and, where it is measured, of the slope of the road, at each lag; the residual,
which holds the hills, is whitened by an autoregression, so that the past of speed and pedal may depend on it (Ljung 1999,
sec. 7.2). The lag minimises the sum of squares.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import autoregression
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.first_order import scan
from canid.values.types import Array, Interval, Trace

# s of usable driving below which no car is fitted: strength and lag were off by more than their intervals on a minute
MIN_USABLE_S = 60.0
# s; the lag of engine, turbocharger and driveline: with more, the pedal of a lorry
MAX_LAG_S = 1.5
# s, of the search; its optimum is then refined by a parabola
LAG_SPACING_S = 0.05
# s at the head of a stretch that the pedal's earlier course, before the log, would still reach
SETTLE_S = 3.0
# half-width of strength's 95 % interval, of its value, above which the car counts as not identified
MAX_HALF_WIDTH = 0.5
# s that are averaged to a row. Of a pedal that moves faster than 10 Hz samples show, less is aliased: with white noise of
# 1.5 % rows of 0.1 s gave a lag of 0.47 s in the place of 0.35 s
ROW_S = 0.5
# orders of the residual's autoregression: 3 s
ORDERS = 6
# standard deviations that the model's own error adds, measured on 30 simulated drives of 6 min without noise of the sensors:
# a drag that grows with the square of the speed, hills, sampling at 10 Hz, and an acceleration from the speed's differences
STRENGTH_ERROR = 0.01  # of its value
LAG_ERROR_S = 0.01
DAMPING_ERROR = 0.002  # 1/s
# fits in turn with the residual's autoregression: the third changes strength by less than 0.1 %
PASSES = 3


class CarResponse(NamedTuple):
    """From the pedal to the acceleration."""

    strength: Interval  # m/s² per %
    lag: Interval  # s
    damping: Interval  # 1/s, by which the deceleration grows with speed
    covariance: Array  # (3, 3) of the three
    used: float  # s of driving


def car_response(trace: Trace) -> CarResponse | str:
    """Estimate the car's response, or why there is none.

    Args:
        trace: of a drive, with the roles pedal and speed, better with accel and grade too.

    Example:
        >>> import canid
        >>> car = car_response(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        >>> car.strength.low < 0.04 < car.strength.high, car.lag.low < 0.35 < car.lag.high  # as simulated
        (True, True)
    """
    signals = trace.signals
    if not {"pedal", "speed"} <= signals.keys():
        return "its response is not known: the vehicle file maps no pedal, or no speed"
    pedal, speed = signals["pedal"], signals["speed"]
    accel = signals["accel"] if "accel" in signals else _slope(speed, trace.dt)
    rows = trace.learn & np.isfinite(pedal) & np.isfinite(speed) & np.isfinite(accel)
    rows &= np.arange(len(rows)) >= round(SETTLE_S / trace.dt)
    used = float(rows.sum() * trace.dt)
    if used < MIN_USABLE_S:
        return f"its response is not known: {used:.0f} s of usable driving, {MIN_USABLE_S:.0f} s are needed"
    grade = signals.get("grade", np.zeros(len(rows)))
    measured = bool(np.isfinite(grade[rows]).all()) and float(np.ptp(grade[rows])) > 0.0
    extra = [np.nan_to_num(grade)] if measured else []
    mean = float(speed[rows].mean())
    fixed = [np.where(np.isfinite(speed), mean - speed, 0.0), np.ones(len(speed)), *extra]
    fit = _fit(_held(pedal), np.array(fixed), np.where(rows, accel, 0.0), rows, trace.dt)
    if fit is None:
        return "its response is not known: the pedal hardly moved"
    value, of_noise = fit
    covariance = of_noise + np.diag([STRENGTH_ERROR * value[0], LAG_ERROR_S, DAMPING_ERROR]) ** 2
    half = NORMAL_QUANTILE * np.sqrt(np.diag(covariance))
    if not value[0] > 0.0 or half[0] > MAX_HALF_WIDTH * value[0]:
        return "its response is not identifiable from this drive: drive with more pedal movement"
    # a lag and a damping below 0 are none
    intervals = [
        Interval(*(max(float(bound), 0.0) for bound in (x, x - h, x + h)))
        for x, h in zip(value, half, strict=True)
    ]
    return CarResponse(intervals[0], intervals[1], intervals[2], covariance, used)


def _slope(speed: Array, dt: float) -> Array:
    """Derivative of the speed by central differences."""
    out: Array = np.gradient(speed, dt)
    return out


def _held(x: Array) -> Array:
    """The last value where nothing was measured, the first one before it."""
    known = np.flatnonzero(np.isfinite(x))
    at = known[np.maximum(np.searchsorted(known, np.arange(len(x)), side="right") - 1, 0)]
    out: Array = x[at]
    return out


def lagged(x: Array, lag: float, dt: float) -> Array:
    """A first-order lag, exact for an input that is straight between samples; at rest before them.

    Args:
        x: (n,).
        lag: s.
        dt: s.

    >>> lagged(np.array([1.0, 1.0, 2.0]), 0.0, 0.1)
    array([1., 1., 2.])
    """
    if lag < 1e-6:
        return x.copy()
    decay = float(np.exp(-dt / lag))
    ramp = lag / dt * (1.0 - decay)
    driven = np.empty(len(x))
    driven[0] = x[0]
    driven[1:] = (ramp - decay) * x[:-1] + (1.0 - ramp) * x[1:]
    return scan(driven, np.array([decay]))


def _fit(
    pedal: Array, fixed: Array, accel: Array, rows: npt.NDArray[np.bool_], dt: float
) -> tuple[Array, Array] | None:
    """Strength, lag and damping, and their covariance (3, 3); None: singular."""
    grid = np.arange(0.0, MAX_LAG_S + 0.5 * LAG_SPACING_S, LAG_SPACING_S)
    columns = [np.vstack([lagged(pedal, lag, dt), fixed]) for lag in grid]
    noise = np.zeros(0)
    lag = 0.3
    beta = np.zeros(len(fixed) + 1)
    per = max(round(ROW_S / dt), 1)
    columns = [_averaged(X, per) for X in columns]
    fixed, accel = _averaged(fixed, per), _averaged(accel[None], per)[0]
    rows = _averaged(rows[None].astype(np.float64), per)[0] > 1.0 - 1e-9

    def answer(lag: float) -> Array:
        return _averaged(lagged(pedal, lag, dt)[None], per)

    for _ in range(PASSES):
        whole = autoregression.whole(rows, len(noise))
        y = autoregression.whiten(accel[None], noise)[0][whole]
        sums = np.array([_least_squares(autoregression.whiten(X, noise)[:, whole], y)[1] for X in columns])
        lag = _vertex(grid, sums)
        X = np.vstack([answer(lag), fixed])
        beta = _least_squares(autoregression.whiten(X, noise)[:, whole], y)[0]
        noise = autoregression.fit(accel - beta @ X, rows, ORDERS)
    whole = autoregression.whole(rows, len(noise))
    low, high = max(lag - 1e-3, 0.0), lag + 1e-3
    by_lag = beta[0] * (answer(high) - answer(low)) / (high - low)
    X = np.vstack([answer(lag), fixed])
    J = autoregression.whiten(np.vstack([X, by_lag]), noise)[:, whole]
    left = autoregression.whiten((accel - beta @ X)[None], noise)[0][whole]
    G = J @ J.T
    size = np.sqrt(np.diag(G))
    if not float(size.min()) > 0.0 or np.linalg.cond(G / np.outer(size, size)) > 1e10:
        return None
    # of a constant nothing is asked: strength, lag (the last column), damping
    keep = [0, len(J) - 1, 1]
    covariance = np.linalg.inv(G) * float(left @ left) / max(len(left) - len(J), 1)
    return np.array([beta[0], lag, beta[1]]), covariance[np.ix_(keep, keep)]


def _averaged(x: Array, per: int) -> Array:
    """Means of `per` samples, (k, n) to (k, n // per)."""
    n = x.shape[1] // per
    out: Array = x[:, : n * per].reshape(len(x), n, per).mean(axis=2)
    return out


def _least_squares(X: Array, y: Array) -> tuple[Array, float]:
    """Coefficients of the rows of X (k, n), and the sum of squares that is left."""
    beta: Array = np.asarray(np.linalg.lstsq(X @ X.T, X @ y, rcond=None)[0], dtype=np.float64)
    left = y - beta @ X
    return beta, float(left @ left)


def _vertex(grid: Array, sums: Array) -> float:
    """Where a parabola through the least sum and its neighbours is least."""
    i = int(np.argmin(sums))
    if i in (0, len(grid) - 1):
        return float(grid[i])
    a, b, c = sums[i - 1 : i + 2]
    return float(grid[i] + 0.5 * (grid[1] - grid[0]) * (a - c) / (a - 2.0 * b + c))
