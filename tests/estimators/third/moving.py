"""Moving least squares with one delay, y_t = b + sum K_i u_i(t - delay); the delay by least residual power.

The third estimator of tests/estimators/test_third_estimator.py, which puts this file next to the other two. One delay
stands for lag and dead time of all inputs, so only the gains and that delay's sum mean something. Intervals by
Newey & West (1987), as far as the gain that K would have if the whole delay were a lag: a lag attenuates, a delay does
not, and that bias is a share of K, which no standard deviation shows.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from canid.mathematics.estimators import status
from canid.mathematics.estimators.estimator import Estimator, WholeDrive
from canid.values.types import Array, Channel, Estimate, Identifiable, Interval, Sample, Status, Trace

NAME = "moving"

# s of lags of the residual's autocorrelation
HAC_LAG_S = 2.0
# share of an input's usual standard deviation that it must move by
MIN_MOVEMENT = 0.05


class MovingSettings(NamedTuple):
    """Window and delays."""

    window: Annotated[float, Field(ge=5.0, le=600.0, allow_inf_nan=False)] = 60.0  # s
    delay_max: Annotated[float, Field(ge=0.0, le=5.0, allow_inf_nan=False)] = 1.5  # s


class Setup(NamedTuple):
    """Inputs, grid and settings."""

    input_names: tuple[str, ...]
    dt: float  # s
    settings: MovingSettings


class State(NamedTuple):
    """What the next step needs."""

    pace: status.Pace
    t: float  # s, of the last sample
    segment: int
    rows: tuple[tuple[float, ...], ...]  # output, inputs; NaN: not usable


def configure(input_names: tuple[str, ...], dt: float, settings: MovingSettings) -> Setup:
    if not input_names or not dt > 0.0:
        raise ValueError(f"inputs {input_names}, dt = {dt} s: one or more inputs, dt > 0")
    return Setup(input_names, dt, settings)


def init(setup: Setup) -> State:
    return State(status.Pace(), math.nan, 0, ())


def advance(setup: Setup, state: State, sample: Sample) -> tuple[State, bool]:
    if not math.isfinite(sample.t) or sample.t <= state.t:
        return state, False
    m, longest = len(sample.inputs), round(setup.settings.window / setup.dt)
    nothing = (math.nan,) * (1 + m)
    lost = round((sample.t - state.t) / setup.dt) - 1 if math.isfinite(state.t) else 0
    if sample.segment != state.segment:
        lost = round(setup.settings.delay_max / setup.dt)
    usable = sample.learn and all(map(math.isfinite, (sample.output, *sample.inputs)))
    row = (sample.output, *sample.inputs) if usable else nothing
    rows = (*state.rows, *(nothing,) * min(lost, longest), row)[-longest:]
    pace, forced = status.by_gate(state.pace, sample)
    state = State(pace, sample.t, sample.segment, rows)
    due = status.due(pace, sample.t, forced) if forced is not None else status.due_from_data(pace, sample.t)
    if not due:
        return state, False
    return state._replace(pace=status.emitted(pace, sample.t, forced or Status.OK)), True


def estimate(setup: Setup, state: State, sample: Sample) -> tuple[State, Estimate]:
    kind = state.pace.kind
    assert kind is not None
    if status.of_gate(state.pace):
        return state, status.without_numbers(sample.t, NAME, kind, sample.gate.value, setup.input_names)
    made = from_rows(setup, sample.t, np.array(state.rows))
    return state._replace(pace=status.emitted(state.pace, sample.t, made.status)), made


def from_rows(setup: Setup, t: float, rows: Array) -> Estimate:
    names = setup.input_names
    usable = np.isfinite(rows).all(axis=1)
    used = float(usable.sum()) * setup.dt
    excitation = dict.fromkeys(names, math.nan)
    if used >= status.MIN_DATA_S:
        excitation = {name: float(rows[usable, 1 + i].std()) for i, name in enumerate(names)}
    moved = any(excitation[name] > MIN_MOVEMENT * status.usual(name) for name in names) or math.isnan(
        excitation[names[0]]
    )
    verdict = status.by_data(used, status.MIN_DATA_S, excitation, moved)
    if verdict is None:
        channels, fit_percent = fit(setup, rows)
        verdict = status.by_fit(channels, excitation)
        if verdict[0] is Status.OK:
            return Estimate(t, NAME, *verdict, channels, fit_percent, excitation, used)
    return status.without_numbers(t, NAME, *verdict, names)._replace(used=used)


def fit(setup: Setup, rows: Array) -> tuple[dict[str, Channel], float]:
    """Channels, and the fit in percent."""
    most = round(setup.settings.delay_max / setup.dt)
    y, u = rows[:, 0], rows[:, 1:]
    if len(rows) < 2 * most + 20:
        return dict.fromkeys(setup.input_names, Channel()), math.nan
    every = [np.column_stack([np.ones(len(y) - most), u[most - d : len(u) - d]]) for d in range(most + 1)]
    usable = np.isfinite(y[most:]) & np.isfinite(np.hstack(every)).all(axis=1)
    if usable.sum() < 20 * len(rows[0]):
        return dict.fromkeys(setup.input_names, Channel()), math.nan
    target = y[most:][usable]
    fits = [np.linalg.lstsq(X[usable], target, rcond=None)[0] for X in every]
    power = [float(np.sum((target - X[usable] @ b) ** 2)) for X, b in zip(every, fits, strict=True)]
    best = int(np.argmin(power))
    X, b = every[best][usable], fits[best]
    scores = X * (target - X @ b)[:, None]
    lags = round(HAC_LAG_S / setup.dt)
    S = scores.T @ scores
    for k in range(1, min(lags, len(scores) - 1) + 1):
        cross = scores[k:].T @ scores[:-k]
        S += (1.0 - k / (lags + 1.0)) * (cross + cross.T)
    inverse = np.linalg.pinv(X.T @ X)
    sd = np.sqrt(np.maximum(np.diag(inverse @ S @ inverse), 0.0))
    share = attenuation(u, X, usable, best)
    channels = {
        name: Channel(
            Interval(float(K), float(min(K, K / a) - 1.96 * s), float(max(K, K / a) + 1.96 * s)),
            status=Identifiable.GAIN_ONLY,
        )
        if abs(K) > 3.0 * s > 0.0
        else Channel()
        for name, K, s, a in zip(setup.input_names, b[1:], sd[1:], share, strict=True)
    }
    variance = float(np.sum((target - target.mean()) ** 2))
    return channels, 100.0 * (1.0 - math.sqrt(power[best] / variance)) if variance > 0.0 else 0.0


def attenuation(u: Array, X: Array, usable: Array, delay: int) -> Array:
    """Gain that least squares finds of each input through a lag of `delay` samples with gain 1, at least 0.2."""
    most = len(u) - len(usable)
    kernel = np.exp(-np.arange(10 * delay + 1) / max(delay, 1e-3))
    means = np.nanmean(np.where(np.isfinite(u), u, np.nan), axis=0)
    moved = np.where(np.isfinite(u), u, means) - means
    lagged = np.column_stack([np.convolve(x, kernel / kernel.sum())[most : len(u)] for x in moved.T])
    return np.clip(np.diag(np.linalg.lstsq(X, lagged[usable], rcond=None)[0][1:]), 0.2, None)


def identify(trace: Trace, settings: MovingSettings) -> WholeDrive:
    setup = configure(trace.input_names, trace.dt, settings)
    rows = np.column_stack([np.where(trace.learn, trace.output, np.nan), trace.inputs])
    channels, fit_percent = fit(setup, rows)
    return WholeDrive(channels, fit_percent=fit_percent, details={"delay_max": settings.delay_max})


MOVING = Estimator(NAME, MovingSettings, configure, init, advance, estimate, identify)
