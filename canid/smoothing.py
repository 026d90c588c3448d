"""Gap and range rate from noisy radar reports: a Kalman filter (filterpy's) with a short fixed lag.

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


Vector = tuple[float, float, float]


class Filtered(NamedTuple):
    """The filter right after one report."""

    t: float
    x: Vector
    P: Array  # (3, 3)
    prior: Vector  # x as the report before expected it
    back: tuple[float, ...]  # (9,) the smoother's gain, from this report to the one before, row by row


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
    x = (gap, range_rate if rate_known else 0.0, 0.0)
    return State((Filtered(t, x, P, x, (0.0,) * 9),))


@cache
def _measuring(noise: Noise, gap: bool, range_rate: bool) -> tuple[Array, Array]:
    """Noise and matrix of a report that has a gap, a range rate or both."""
    known = np.array([gap, range_rate])
    return np.diag([noise.gap**2, noise.range_rate**2])[np.ix_(known, known)], np.eye(3)[:2][known]


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
    kf.x, kf.P = np.array(last.x), last.P.copy()
    kf.predict(F=F, Q=Q)
    # Rauch, Tung & Striebel 1965, eq. 3.29: what this report will say of the one before depends on no later one
    back = last.P @ F.T @ np.linalg.inv(kf.P)
    prior: Vector = tuple(kf.x.tolist())
    R, H = _measuring(noise, gap == gap, range_rate == range_rate)
    kf.update(np.array([z for z in (gap, range_rate) if z == z]), R=R, H=H)
    x: Vector = tuple(kf.x.tolist())
    history = (*state.history, Filtered(t, x, kf.P, prior, tuple(back.ravel().tolist())))
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
    """Go back from the newest report, in plain floats: there are a few reports, of three numbers each."""
    if not history:
        return []
    gap, rate, accel = history[-1].x
    out = [Smoothed(history[-1].t, gap, rate)]
    for item, later in zip(history[-2::-1], history[:0:-1], strict=True):
        p, q, r = later.prior
        d, e, f = gap - p, rate - q, accel - r
        g = later.back
        gap, rate, accel = item.x
        gap += g[0] * d + g[1] * e + g[2] * f
        rate += g[3] * d + g[4] * e + g[5] * f
        accel += g[6] * d + g[7] * e + g[8] * f
        out.append(Smoothed(item.t, gap, rate))
    out.reverse()
    return out
