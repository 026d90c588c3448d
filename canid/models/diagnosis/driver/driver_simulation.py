"""Step-by-step simulation of a fitted driver, several stretches side by side: inputs up to now -> demand.

The same hooks of the same effects as in `driver_model`; arrays (m,) hold one value per stretch. The inputs are the
simulated ones, without sensor noise, so nothing is estimated from reports.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.models.diagnosis.driver.driver_model import (
    DESIRED,
    FREE_SPEED,
    K1,
    K2,
    MIN_HEADWAY_SPEED,
    STANDSTILL,
    TAU1,
    TAU2,
    THETA1,
    THETA2,
    DriverModel,
    offset,
)
from canid.models.effects.effect import Effect, Seen, Value
from canid.models.effects.wanted_gap import error
from canid.values.findings import Flags
from canid.values.types import Array

# s of what was seen before a stretch begins: the longest dead time, and its drift
HISTORY_S = 4.0


class Late(NamedTuple):
    """Inputs, one row per sample and one column per stretch; later rows are not used."""

    gap: Array  # m
    range_rate: Array  # m/s
    speed: Array  # m/s
    lead_accel: Array  # m/s²
    t: Array  # s


class SimulatedDriver(NamedTuple):
    """Parameters of the driver of each stretch."""

    model: DriverModel
    q: Array  # (parameters, m)
    begun: tuple[Array, Array]  # (m,) what both lags hold at the begin
    added: Array  # (samples, m) output unit: contribution of a random walk of the desired headway
    held: Flags  # (samples, m) the pedal stands still
    ceiling: float  # output unit
    duration: float  # s, of the whole drive


class State(NamedTuple):
    """What the next step depends on."""

    inputs: tuple[Array, Array] | None  # into both lags; None: at the begin
    lags: tuple[Array, Array]
    pedals: tuple[tuple[Any, ...], ...]  # of each cause behind the lags, of each stretch
    output: Array | None


Step = Callable[[State, Late, int], tuple[State, Array]]


class Between(NamedTuple):
    """An instant between two samples, of each column; (1,) where it is the same of all."""

    before: npt.NDArray[np.int64]  # (m,) rows
    after: npt.NDArray[np.int64]
    part: Array  # (m,) of the earlier one


def earlier(k: int, delay: Array, dt: float) -> Between:
    """The instant t_k − delay (m,)."""
    same = delay[:1] if (delay == delay[0]).all() else delay
    # a delay of whole samples must not fall between two by rounding
    at = np.round(k - same / dt, 9)
    whole = np.floor(at).astype(np.int64)
    return Between(whole, np.minimum(whole + 1, k), 1 - (at - whole))


def recalled(x: Array, at: Between) -> Array:
    """Return each column of x at an instant, straight between samples.

    Example:
        >>> x = np.stack([np.arange(5.0), 10 * np.arange(5.0)], axis=1)
        >>> recalled(x, earlier(4, np.array([0.15, 0.2]), 0.1)).tolist()
        [2.5, 20.0]
    """
    if at.before.size == 1:
        # a row is taken faster than an element of each column
        before, after = x[at.before[0]], x[at.after[0]]
    else:
        columns = np.arange(x.shape[1])
        before, after = x[at.before, columns], x[at.after, columns]
    out: Array = at.part * before + (1 - at.part) * after
    return out


def _own_parameters(simulated: SimulatedDriver) -> list[tuple[Array, Effect]]:
    """Each effect of the model with its parameters (k, m)."""
    return [
        (simulated.q[where], effect)
        for effect, where in zip(simulated.model.effects, simulated.model.where, strict=True)
    ]


def _seen(simulated: SimulatedDriver, late: Late, k: int, delay: Array, dt: float) -> Seen:
    """Inputs at sample k, `delay` (m,) s earlier."""
    columns = (late.gap, late.range_rate, late.speed, late.lead_accel)
    at = earlier(k, delay, dt)
    gap, rate, speed, accel = (recalled(x, at) for x in columns)
    return Seen(
        late.t[k], simulated.duration, gap / np.maximum(speed, MIN_HEADWAY_SPEED), rate, gap, speed, accel
    )


def _lag_inputs(
    simulated: SimulatedDriver, effects: list[tuple[Array, Effect]], late: Late, k: int, dt: float
) -> tuple[Array, Array]:
    """Inputs of both lags at sample k, (m,) each."""
    q = simulated.q
    clock = Seen(late.t[k], simulated.duration, 0.0, 0.0, 0.0, 0.0, 0.0)
    delays = [q[THETA1], q[THETA2]]
    for p, effect in effects:
        if effect.dead_time is not None:
            delays = [delay + effect.dead_time(p, clock) for delay in delays]
    first, second = (_seen(simulated, late, k, np.clip(delay, 0.0, HISTORY_S - dt), dt) for delay in delays)
    e: Value = error(simulated.model.form, q[DESIRED], q[STANDSTILL], q[FREE_SPEED], first)
    w: Value = second.range_rate
    gain: Value = 1.0
    extra: Value = 0.0
    for p, effect in effects:
        if effect.headway is not None:
            e = effect.headway(p, e, first)
        if effect.range_rate is not None:
            w = effect.range_rate(p, w, second)
        if effect.gain is not None:
            gain = gain * effect.gain(p, second)
        if effect.extra is not None:
            extra = extra + effect.extra(p, second)
    return gain * q[K1] * e, gain * q[K2] * w + extra


def driver(simulated: SimulatedDriver, dt: float) -> tuple[Callable[[], State], Step]:
    """Return `init()` and `step(state, late, k)` -> state, demand (m,) in the output's unit, before the floor.

    Args:
        simulated: the drivers.
        dt: s.
    """
    q = simulated.q
    effects = _own_parameters(simulated)
    pedals = [(p, effect.pedal) for p, effect in effects if effect.pedal is not None]
    tau = np.maximum(q[[TAU1, TAU2]], 1e-4)
    decay = np.exp(-dt / tau)
    ramp = tau / dt * (1 - decay)

    def init() -> State:
        return State(None, simulated.begun, (), None)

    def step(state: State, late: Late, k: int) -> tuple[State, Array]:
        now = _lag_inputs(simulated, effects, late, k, dt)
        lags = state.lags
        if state.inputs is not None:
            # exact for an input that is straight between samples
            first, second = (
                decay[c] * lags[c] + (ramp[c] - decay[c]) * state.inputs[c] + (1 - ramp[c]) * now[c]
                for c in (0, 1)
            )
            lags = (first, second)
        demand: Array = offset(simulated.model, q, late.t[k]) + lags[0] + lags[1]
        before = state.pedals or tuple(
            tuple(pedal.init(p[:, m], float(x)) for m, x in enumerate(demand)) for p, pedal in pedals
        )
        after = []
        for (p, pedal), states in zip(pedals, before, strict=True):
            moved = [
                pedal.step(p[:, m], pedal_state, float(x), dt)
                for m, (pedal_state, x) in enumerate(zip(states, demand, strict=True))
            ]
            after.append(tuple(pedal_state for pedal_state, _ in moved))
            demand = np.array([y for _, y in moved])
        demand = np.minimum(demand + simulated.added[k], simulated.ceiling)
        if state.output is not None:
            demand = np.where(simulated.held[k], state.output, demand)
        return State(now, lags, tuple(after), demand), demand

    return init, step
