"""The car's acceleration from pedal and speed, with some causes in it: a whole drive at once, or step by step.

pedal ──map──▶ P′ ─1/(1+τs)─▶ D ─further lags, thrust─▶ D′,   a = Kp D′ − c0 − c2 v² + push
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import dtbsv

from canid.models.diagnosis.driver.driver_model import lagged
from canid.models.diagnosis.fitting.likelihood import Noise
from canid.models.diagnosis.fitting.model import box
from canid.models.diagnosis.vehicle.vehicle_data import VehicleData, VehicleSeen
from canid.models.effects.effect import Effect, Value, VehicleState
from canid.values.types import Array

STRENGTH, LAG, ROLLING, DRAG = range(4)
# physical box: m/s² per %, s, m/s² (with a constant slope of 10 %), 1/m (with a wind). A lorry has 0.005 m/s² per %; a
# motor that brakes at a released pedal slows its car by up to 3 m/s², and a bound that is too low bends the pedal's map
LOW = (0.001, 0.0, -1.2, -0.002)
HIGH = (0.5, 3.0, 4.5, 0.005)
SCALE = (0.01, 0.2, 0.1, 1e-4)


class VehicleModel(NamedTuple):
    """The baseline and some causes, as a function of their parameters."""

    effects: tuple[Effect, ...]
    low: Array  # (k,)
    high: Array
    scale: Array
    where: tuple[slice, ...]  # each effect's parameters in q

    @property
    def delays(self) -> tuple[tuple[int, int], ...]:
        """A car has a lag only."""
        return ()

    @property
    def one_signed(self) -> bool:
        """Strengths of a car's effects have any sign."""
        return False

    def with_effects(self, effects: Sequence[Effect]) -> VehicleModel:
        """Return the car with these effects."""
        return with_effects(effects)

    def free(self) -> tuple[int, ...]:
        """All parameters."""
        return tuple(range(len(self.low)))

    def bind(self, data: VehicleData, noise: Noise | None = None) -> Callable[[Array], Array]:
        """Return the acceleration, as it is measured, as a function of the parameters alone."""
        return lambda q: data.as_measured(accel(self, data.seen, q, data.output.dt))

    def ties(self, data: VehicleData) -> Array | None:
        """Nothing is known beforehand."""
        return None

    def noise_features(self, data: VehicleData, simulated: Array) -> Array | None:
        """The noise of a car is the same everywhere."""
        return None


def with_effects(effects: Sequence[Effect]) -> VehicleModel:
    """Return the car with some effects.

    Example:
        >>> from canid.models.effects import CATALOGUE
        >>> with_effects([effect for effect in CATALOGUE if effect.vehicle and effect.vehicle.pedal]).where
        (slice(4, 5, None),)
    """
    return VehicleModel(*box(effects, LOW, HIGH, SCALE))


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
        if effect.vehicle is not None and effect.vehicle.pedal is not None:
            pressed = effect.vehicle.pedal(p, pressed)
    drive = lagged(pressed, float(q[LAG]), dt)
    felt = VehicleState(seen.t, seen.pedal, seen.speed, seen.slope, seen.gear, drive, float(q[STRENGTH]))
    given = drive
    for p, effect in _each(model, q):
        if effect.vehicle is not None and effect.vehicle.lag is not None:
            given = _through(given, effect.vehicle.lag(p, felt), dt)
    felt = felt._replace(lagged_pedal=given)
    out: Array = _sum(model, q, given, felt)
    return out


def _sum(model: VehicleModel, q: Array, given: Value, felt: VehicleState) -> Value:
    """From the lagged pedal to the acceleration."""
    push: Value = 0.0
    for p, effect in _each(model, q):
        if effect.vehicle is None:
            continue
        if effect.vehicle.thrust is not None:
            given = effect.vehicle.thrust(p, given, felt)
        if effect.vehicle.push is not None:
            push = push + effect.vehicle.push(p, felt)
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
    forced[0] += decay[0] * x[0]
    # y_k − decay_k y_(k−1) = forced_k: a lower triangle of two diagonals
    band = np.ones((2, x.size), order="F")
    band[1, :-1] = -decay[1:]
    out: Array = dtbsv(1, band, forced, lower=1, diag=1)
    out[0] = float(x[0])
    return out


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
    lags = [(p, e.vehicle.lag) for p, e in pairs if e.vehicle is not None and e.vehicle.lag is not None]
    maps = [(p, e.vehicle.pedal) for p, e in pairs if e.vehicle is not None and e.vehicle.pedal is not None]
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
        felt = VehicleState(0.0, pedal, speed, slope, gear, drive, strength)
        was, x, further = state.drive, drive, []
        for (p, lag), y in zip(lags, state.further, strict=True):
            a, b, c = _weights(lag(p, felt), dt)
            was, x = y, a * y + b * was + c * x
            further.append(x)
        return CarState(pressed, drive, tuple(further)), _sum(model, q, x, felt._replace(lagged_pedal=x))

    return FittedCar(init, step)
