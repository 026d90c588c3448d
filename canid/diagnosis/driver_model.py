"""The pedal that a driver with some causes in him would give, from what he saw: open loop, whole drives at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from canid.diagnosis.driver_data import DriverData
from canid.effects.cause import Effect, Seen
from canid.types import Array

# of the baseline, in this order, before those of the causes
BASE = ("offset", "K1", "K2", "tau1", "tau2", "dead_time1", "dead_time2", "headway_desired")
OFFSET, K1, K2, TAU1, TAU2, THETA1, THETA2, DESIRED = range(8)
# physical box: gains of either sign, so that a sign error shows; lags and dead times as in FopdtSettings
LOW = (-300.0, -100.0, -100.0, 0.0, 0.0, 0.0, 0.0, 0.2)
HIGH = (300.0, 100.0, 100.0, 3.0, 3.0, 3.0, 1.6, 6.0)
# m/s; below it a headway means nothing
SLOWEST = 1.0
SCALE = (5.0, 2.0, 2.0, 0.3, 0.3, 0.3, 0.3, 0.5)


class DriverModel(NamedTuple):
    """The baseline and some causes, as a function of their parameters."""

    effects: tuple[Effect, ...]
    low: Array  # (k,)
    high: Array
    scale: Array
    where: tuple[slice, ...]  # each effect's parameters in q

    @property
    def centred(self) -> bool:
        """Is the desired headway itself visible?"""
        return any(effect.centred for effect in self.effects)

    def free(self) -> tuple[int, ...]:
        """Parameters that a fit may move."""
        return tuple(k for k in range(len(self.low)) if k != DESIRED or self.centred)


def with_effects(effects: Sequence[Effect]) -> DriverModel:
    """Lay out the parameters of the baseline and some causes."""
    low, high, scale, where = list(LOW), list(HIGH), list(SCALE), []
    for effect in effects:
        where.append(slice(len(low), len(low) + len(effect.parameters)))
        low += [p.low for p in effect.parameters]
        high += [p.high for p in effect.parameters]
        scale += [abs(p.typical) or 1.0 for p in effect.parameters]
    return DriverModel(tuple(effects), np.array(low), np.array(high), np.array(scale), tuple(where))


def delayed(x: Array, delay: float, dt: float) -> Array:
    """Return x(t − delay), straight between samples; before the first sample it stood still.

    Example:
        >>> delayed(np.array([0.0, 1.0, 2.0]), 0.15, 0.1)
        array([0. , 0. , 0.5])
    """
    steps = delay / dt
    whole = math.floor(steps)
    part = steps - whole
    n = x.size
    padded = np.concatenate([np.full(min(whole + 1, n), x[0]), x[: max(n - whole, 0)]])[: n + 1]
    out: Array = part * padded[:n] + (1 - part) * padded[1 : n + 1]
    return out


def _seen(data: DriverData, delay: float | Array) -> Seen:
    """What the driver acts on: everything but the clock is late by his dead time."""
    seen, dt = data.seen, data.output.dt
    if isinstance(delay, float):
        gap, rate = _recalled(data.known.gap, delay, dt), _recalled(data.known.range_rate, delay, dt)
        speed, accel = delayed(seen.speed, delay, dt), delayed(seen.lead_accel, delay, dt)
    else:
        then = seen.t - delay
        gap, rate = _recalled_at(data.known.gap, delay, dt), _recalled_at(data.known.range_rate, delay, dt)
        speed, accel = np.interp(then, seen.t, seen.speed), np.interp(then, seen.t, seen.lead_accel)
    headway = gap / np.maximum(speed, SLOWEST)
    return seen._replace(headway=headway, range_rate=rate, gap=gap, speed=speed, lead_accel=accel)


def _recalled(lags: Array, delay: float, dt: float) -> Array:
    """Return x(t − delay) as known at t: between two lags straight, beyond the last one delayed further."""
    last = lags.shape[1] - 1
    steps = delay / dt
    if steps >= last:
        return delayed(lags[:, last], delay - last * dt, dt)
    whole = math.floor(steps)
    part = steps - whole
    out: Array = (1 - part) * lags[:, whole] + part * lags[:, whole + 1]
    return out


def _recalled_at(lags: Array, delay: Array, dt: float) -> Array:
    """Return the same for a delay (n,) that changes."""
    steps = np.minimum(delay / dt, lags.shape[1] - 1.001)
    whole = steps.astype(np.int64)
    part = steps - whole
    rows = np.arange(len(lags))
    out: Array = (1 - part) * lags[rows, whole] + part * lags[rows, whole + 1]
    return out


def lagged(x: Array, tau: float, dt: float) -> Array:
    """Return x through 1/(1 + τs), exact for an x that is straight between samples; begins at rest.

    Example:
        >>> lagged(np.array([1.0, 1.0, 1.0]), 0.5, 0.1)
        array([1., 1., 1.])
    """
    if tau < 1e-4:
        return x
    decay = math.exp(-dt / tau)
    ramp = tau / dt * (1 - decay)
    now, before = 1 - ramp, ramp - decay
    out: Array = lfilter([now, before], [1.0, -decay], x, zi=[(1 - now) * x[0]])[0]
    return out


class Parts(NamedTuple):
    """The demand before the lag, (n,) each."""

    e: Array  # s, acted upon
    w: Array  # m/s, acted upon
    gain: Array | float
    extra: Array | float


def parts(model: DriverModel, data: DriverData, q: Array) -> Parts:
    """What enters the lag."""
    theta1: float | Array = float(q[THETA1])
    theta2: float | Array = float(q[THETA2])
    for effect, where in zip(model.effects, model.where, strict=True):
        if effect.dead_time is not None:
            added = effect.dead_time(q[where], data.seen)
            theta1, theta2 = np.maximum(theta1 + added, 0.0), np.maximum(theta2 + added, 0.0)
    first = _seen(data, theta1)
    second = _seen(data, theta2)
    e, w = first.headway - q[DESIRED], second.range_rate
    gain: Array | float = 1.0
    extra: Array | float = 0.0
    for effect, where in zip(model.effects, model.where, strict=True):
        p = q[where]
        if effect.headway is not None:
            e = effect.headway(p, e, first)
        if effect.range_rate is not None:
            w = effect.range_rate(p, w, second)
        if effect.gain is not None:
            gain = gain * effect.gain(p, second)
        if effect.extra is not None:
            extra = extra + effect.extra(p, second)
    return Parts(e, w, gain, extra)


def pedal(model: DriverModel, data: DriverData, q: Array) -> Array:
    """Return the output that the driver would give, without noise and before its limits.

    Args:
        model: which causes.
        data: what he saw.
        q: (k,) parameters, in the order of `BASE` and then the causes'.

    Returns:
        (n,) output unit.
    """
    dt = data.output.dt
    of = parts(model, data, q)
    first = lagged(of.gain * q[K1] * of.e, float(q[TAU1]), dt)
    out: Array = q[OFFSET] + first + lagged(of.gain * q[K2] * of.w + of.extra, float(q[TAU2]), dt)
    for effect, where in zip(model.effects, model.where, strict=True):
        if effect.foot is None:
            continue
        p = q[where]
        if effect.foot.column is not None:
            out = effect.foot.column(p, out, dt)
        else:
            state = effect.foot.init(p, float(out[0]))
            step, moved = effect.foot.step, []
            for demand in out.tolist():
                state, y = step(p, state, demand, dt)
                moved.append(y)
            out = np.array(moved)
    return out


def bound(model: DriverModel, data: DriverData) -> Callable[[Array], Array]:
    """Return the model as a function of its parameters alone."""
    return lambda q: pedal(model, data, q)
