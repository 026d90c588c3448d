"""The car's acceleration from pedal and speed, with some causes in it: a whole drive at once, or step by step.

pedal ──map──▶ P′ ─1/(1+τs)─▶ D ─further lags, thrust─▶ D′,   a = Kp D′ − c0 − c2 v² + push
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver_model import lagged
from canid.effects.cause import CarSeen, Effect, Value
from canid.types import Array

# of the baseline, in this order, before those of the causes
BASE = ("strength", "lag", "rolling", "drag")
STRENGTH, LAG, ROLLING, DRAG = range(4)
# physical box: m/s² per %, s, m/s² (with a constant slope of 10 %), 1/m (with a wind). A lorry has 0.005 m/s² per %
LOW = (0.001, 0.0, -1.2, -0.002)
HIGH = (0.5, 3.0, 2.0, 0.005)
SCALE = (0.01, 0.2, 0.1, 1e-4)


class VehicleModel(NamedTuple):
    """The baseline and some causes, as a function of their parameters."""

    effects: tuple[Effect, ...]
    low: Array  # (k,)
    high: Array
    scale: Array
    where: tuple[slice, ...]  # each effect's parameters in q


class VehicleSeen(NamedTuple):
    """Columns (n,) of one drive; holes filled."""

    t: Array  # s since the drive's first sample
    pedal: Array  # %
    speed: Array  # m/s
    slope: Array  # mean 0, standard deviation 1; 0 where nobody measures it
    gear: Array


def with_effects(effects: Sequence[Effect]) -> VehicleModel:
    """Lay out the parameters of the baseline and some causes.

    Example:
        >>> from canid.effects import pedal_map
        >>> with_effects((pedal_map.EFFECT,)).where
        (slice(4, 5, None),)
    """
    low, high, scale, where = list(LOW), list(HIGH), list(SCALE), []
    for effect in effects:
        where.append(slice(len(low), len(low) + len(effect.parameters)))
        low += [p.low for p in effect.parameters]
        high += [p.high for p in effect.parameters]
        scale += [abs(p.typical) for p in effect.parameters]
    return VehicleModel(tuple(effects), np.array(low), np.array(high), np.array(scale), tuple(where))


def accel(model: VehicleModel, seen: VehicleSeen, q: Array, dt: float) -> Array:
    """Return the acceleration that the car would have, without noise.

    Args:
        model: which causes.
        seen: what was measured.
        q: (k,) parameters, in the order of `BASE` and then the causes'.
        dt: step, s.

    Returns:
        (n,) m/s².

    Example:
        >>> seen = VehicleSeen(np.zeros(2), np.full(2, 10.0), np.full(2, 20.0), np.zeros(2), np.zeros(2))
        >>> accel(with_effects(()), seen, np.array([0.04, 0.3, 0.2, 0.0005]), 0.1).tolist()
        [0.0, 0.0]
    """
    pressed: Array = seen.pedal
    for p, effect in _each(model, q):
        if effect.car is not None and effect.car.pedal is not None:
            pressed = effect.car.pedal(p, pressed)
    drive = lagged(pressed, float(q[LAG]), dt)
    felt = CarSeen(seen.t, seen.pedal, seen.speed, seen.slope, seen.gear, drive, float(q[STRENGTH]))
    given = drive
    for p, effect in _each(model, q):
        if effect.car is not None and effect.car.lag is not None:
            given = _through(given, effect.car.lag(p, felt), dt)
    felt = felt._replace(drive=given)
    out: Array = _sum(model, q, given, felt)
    return out


def _sum(model: VehicleModel, q: Array, given: Value, felt: CarSeen) -> Value:
    """From the lagged pedal to the acceleration."""
    push: Value = 0.0
    for p, effect in _each(model, q):
        if effect.car is None:
            continue
        if effect.car.thrust is not None:
            given = effect.car.thrust(p, given, felt)
        if effect.car.push is not None:
            push = push + effect.car.push(p, felt)
    return q[STRENGTH] * given - q[ROLLING] - q[DRAG] * felt.speed * felt.speed + push


def _each(model: VehicleModel, q: Array) -> list[tuple[Array, Effect]]:
    return [(q[where], effect) for effect, where in zip(model.effects, model.where, strict=True)]


def _weights(tau: Value, dt: float) -> tuple[Value, Value, Value]:
    """Of y, the input before and the input now in the next y; exact for an input that is straight in between."""
    tau = np.maximum(tau, 1e-4)
    decay = np.exp(-dt / tau)
    ramp = tau / dt * (1 - decay)
    return decay, ramp - decay, 1 - ramp


def _through(x: Array, tau: Value, dt: float) -> Array:
    """Through 1/(1 + τs) with a lag that may change from sample to sample."""
    if np.ndim(tau) == 0:
        return lagged(x, float(tau), dt)
    decay, before, now = _weights(tau, dt)
    forced = now * x
    forced[1:] += before[1:] * x[:-1]
    y, out = float(x[0]), []
    for keep, force in zip(decay.tolist(), forced.tolist(), strict=True):
        y = keep * y + force
        out.append(y)
    out[0] = float(x[0])
    return np.array(out)


class CarState(NamedTuple):
    """What the next step of a car, or of several side by side (m,), depends on."""

    pressed: Value  # %, after the map
    drive: Value  # %, after the first lag
    further: tuple[Value, ...]  # %, after each further one


class FittedCar(NamedTuple):
    """A car that can be driven: `init(pedal)` and `step(state, pedal, speed, slope, gear)` -> state, m/s²."""

    init: Callable[[Value], CarState]
    step: Callable[[CarState, Value, Value, Value, Value], tuple[CarState, Value]]


def drivable(model: VehicleModel, q: Array, dt: float) -> FittedCar:
    """Return the fitted model as a car that can be driven; floats or arrays (m,) of cars side by side.

    Args:
        model: which causes.
        q: (k,) its parameters.
        dt: s; of one step.

    Example:
        >>> car = drivable(with_effects(()), np.array([0.04, 0.0, 0.2, 0.0]), 0.1)
        >>> round(float(car.step(car.init(5.0), 10.0, 20.0, 0.0, 4.0)[1]), 3)
        0.2
    """
    pairs = _each(model, q)
    lags = [(p, e.car.lag) for p, e in pairs if e.car is not None and e.car.lag is not None]
    maps = [(p, e.car.pedal) for p, e in pairs if e.car is not None and e.car.pedal is not None]
    keep, before, now = _weights(float(q[LAG]), dt)
    strength = float(q[STRENGTH])

    def mapped(pedal: Value) -> Value:
        for p, bend in maps:
            pedal = bend(p, pedal)
        return pedal

    def init(pedal: Value) -> CarState:
        at = mapped(pedal)
        return CarState(at, at, (at,) * len(lags))

    def step(
        state: CarState, pedal: Value, speed: Value, slope: Value, gear: Value
    ) -> tuple[CarState, Value]:
        pressed = mapped(pedal)
        drive = keep * state.drive + before * state.pressed + now * pressed
        felt = CarSeen(0.0, pedal, speed, slope, gear, drive, strength)
        was, x, further = state.drive, drive, []
        for (p, lag), y in zip(lags, state.further, strict=True):
            a, b, c = _weights(lag(p, felt), dt)
            was, x = y, a * y + b * was + c * x
            further.append(x)
        return CarState(pressed, drive, tuple(further)), _sum(model, q, x, felt._replace(drive=x))

    return FittedCar(init, step)
