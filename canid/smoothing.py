"""Gap and range rate from noisy radar reports: a Kalman filter with a short fixed lag (filterpy's filter and smoother).

State: gap, range rate, relative acceleration. The lag lets the next few reports correct an estimate, and no more
than that: what is smoothed with all of the future carries the driver's own answer back into his input, and then
biases everything that is identified from it.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from canid.types import Array

# s; a person answers after 0.2 s or more, so nothing that the driver does at t has entered an input at t − 0.2 s
LAG = 0.2
# (m/s³)²·s; white jerk of the relative motion. Traffic itself has 0.4 (0.6 m/s² over 2 s), but a filter that trusts it
# delays a range rate that moves at 0.2 to 0.5 Hz by 7 to 30 ms, which the driver then seems to answer too soon. With
# eight times that it is 1 to 8 ms, for an eighth more noise (0.040 m/s, reports at 20 Hz)
JERK = 3.0
# s; longer than this without a report and the target may be another one
BRIDGE = 0.5
# m; another vehicle is at least a short car's length nearer or further. Less than that is the sensor: real gaps
# (data/openacc) drift against their own range rate by 1 m/s, so no test in units of the stated noise can hold
ELSEWHERE = 2.0
# m/s²; no vehicle changes the range rate faster (emergency braking of one of the two)
HARDEST = 10.0
# standard deviations of the report's own noise on top of both: one false alarm in 2 million reports
SIGMAS = 5.0
# reports in a row that do not fit, before the target is another one: a single one is an outlier
FOREIGN_REPORTS = 3


class Noise(NamedTuple):
    """Standard deviations of the radar's reports."""

    gap: float = 0.25  # m, typical of 77 GHz automotive radar
    range_rate: float = 0.12  # m/s


class Filtered(NamedTuple):
    """The filter right after one report."""

    t: float
    x: Array  # (3,)
    P: Array  # (3, 3)
    F: Array  # (3, 3) from the report before
    Q: Array  # (3, 3)


class Smoothed(NamedTuple):
    """One report, smoothed."""

    t: float
    gap: float  # m
    range_rate: float  # m/s


class State(NamedTuple):
    """Reports whose smoothing is not over; the last one is the newest."""

    history: tuple[Filtered, ...] = ()
    foreign: int = 0  # reports in a row that did not fit
    started: bool = False  # has history[0] been given out?


@cache
def _filter() -> Any:
    # filterpy costs 1.5 s to import: not before the first report of a lead
    from filterpy.kalman import KalmanFilter

    return KalmanFilter(dim_x=3, dim_z=2)


def load() -> None:
    """Import what the first report would import."""
    _filter()


def _motion(dt: float) -> tuple[Array, Array]:
    """Transition and process noise of a white-jerk motion over dt (Bar-Shalom 2001, eq. 6.2.3-7)."""
    F = np.array([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    a, b, c = dt**5 / 20, dt**4 / 8, dt**3 / 6
    Q = JERK * np.array([[a, b, c], [b, dt**3 / 3, dt * dt / 2], [c, dt * dt / 2, dt]])
    return F, Q


def _start(t: float, gap: float, range_rate: float, noise: Noise) -> State:
    rate_known = range_rate == range_rate
    # an unknown range rate is within ±20 m/s; relative accelerations stay within ±2 m/s²
    P = np.diag([noise.gap**2, noise.range_rate**2 if rate_known else 100.0, 1.0])
    x = np.array([gap, range_rate if rate_known else 0.0, 0.0])
    return State((Filtered(t, x, P, np.eye(3), np.zeros((3, 3))),))


def fits(state: State, t: float, gap: float, range_rate: float, noise: Noise) -> bool:
    """Could this report be of the object that is being followed?"""
    if not state.history:
        return False
    last = state.history[-1]
    if t - last.t > BRIDGE:
        return False
    dt = t - last.t
    expected = last.x[0] + last.x[1] * dt
    near = not abs(gap - expected) > ELSEWHERE + SIGMAS * noise.gap
    # comparisons with NaN are false: what the report does not say does not speak against it
    return near and not abs(range_rate - last.x[1]) > HARDEST * dt + SIGMAS * noise.range_rate


def step(
    state: State, t: float, gap: float, range_rate: float, noise: Noise
) -> tuple[State, list[Smoothed], bool]:
    """Take one report.

    Args:
        state: from `State()` or the step before.
        t: time of the report in s, not before the last one's.
        gap: m; NaN if the report has none.
        range_rate: m/s; NaN if the report has none.
        noise: of the radar.

    Returns:
        the next state, the reports that are now smoothed with a lag of `LAG`, and whether the target has changed
        (then `flush` was applied to the old one before).

    Example:
        >>> state = State()
        >>> for k in range(20):
        ...     state, smoothed, changed = step(state, k * 0.05, 30.0 + k * 0.05, 1.0, Noise())
        >>> round(smoothed[0].gap, 2), round(smoothed[0].range_rate, 2), changed
        (30.75, 1.0, False)
    """
    if gap != gap and (range_rate != range_rate or not state.history):
        return state, [], False
    if not state.history:
        return _start(t, gap, range_rate, noise), [], False
    if not fits(state, t, gap, range_rate, noise):
        gone = t - state.history[-1].t > BRIDGE
        if gap != gap or (not gone and state.foreign + 1 < FOREIGN_REPORTS):
            return state._replace(foreign=state.foreign + 1), [], False
        return _start(t, gap, range_rate, noise), flush(state), True
    last = state.history[-1]
    F, Q = _motion(t - last.t)
    kf = _filter()
    kf.x, kf.P = last.x.copy(), last.P.copy()
    kf.predict(F=F, Q=Q)
    z = np.array([gap, range_rate])
    known = np.isfinite(z)
    R = np.diag([noise.gap**2, noise.range_rate**2])[np.ix_(known, known)]
    kf.update(z[known], R=R, H=np.eye(3)[:2][known])
    history = (*state.history, Filtered(t, kf.x, kf.P, F, Q))
    # times are whole nanoseconds: half of one keeps a report that is exactly LAG old on this side
    ready = sum(item.t <= t - LAG + 5e-10 for item in history)
    out = _smooth(history)[1 if state.started else 0 : ready] if ready > state.started else []
    # one report that was given out stays in front: it is where the next stretch begins
    kept = history[max(ready - 1, 0) :]
    return State(kept, 0, ready > 0), out, False


def flush(state: State) -> list[Smoothed]:
    """Return the rest, smoothed with what there is: the target is gone."""
    return _smooth(state.history)[1 if state.started else 0 :]


def _smooth(history: tuple[Filtered, ...]) -> list[Smoothed]:
    if not history:
        return []
    X = np.array([item.x for item in history])
    if len(history) > 1:
        P = np.array([item.P for item in history])
        F = [item.F for item in history]
        Q = [item.Q for item in history]
        X = _filter().rts_smoother(X, P, F, Q)[0]
    return [Smoothed(item.t, float(x[0]), float(x[1])) for item, x in zip(history, X, strict=True)]
