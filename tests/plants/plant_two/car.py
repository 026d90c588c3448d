"""The car of simulator two: a pedal map that is not quite linear, an engine of two stages, engine braking, gusts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tests.plants.plant_two.shapes import below, switch

GRAVITY = 9.81  # m/s²
# %; below this the driver changes from the accelerator to the brake
BRAKE_PEDAL_BELOW = -2.0
# %; where pedal maps of any curvature agree, a usual cruising position
MAP_CENTRE = 12.0
# m/s; up-shifts of an automatic gearbox at light load, and its revolutions (rpm per m/s) in each gear
SHIFTS = (4.5, 8.0, 13.5, 20.0, 27.0)
REVOLUTIONS = (410.0, 240.0, 160.0, 115.0, 92.0, 76.0)


class Car(NamedTuple):
    """A compact car. The small values of the effects' parameters are what every car has of them."""

    gain: float = 0.034  # m/s² per % pedal
    brake: float = (
        0.13  # m/s² per % below `BRAKE_PEDAL_BELOW`; with much less a linear driver runs into the lead
    )
    rolling: float = 0.17  # m/s²
    drag: float = 3.2e-4  # 1/m
    first_lag: float = 0.10  # s, manifold
    second_lag: float = 0.22  # s, crankshaft to wheels
    brake_lag: float = 0.14  # s
    curvature: float = 0.03  # of the pedal map: acceleration ~ pedal^(1 + curvature)
    engine_braking: float = 0.10  # m/s² with the pedal released
    turbo_lag: float = 0.0  # s more at low load
    gear_ratio: float = 0.0  # share by which the gain falls from gear to gear
    power_limit: float = 40.0  # W/kg
    grade: float = 0.0  # %, sd of the road's slope
    headwind: float = 0.0  # m/s
    gusts: float = 1.5  # m/s, sd

    def hold(self, v: float) -> float:
        """Pedal (%) that holds a speed (m/s) on a level road.

        >>> 5.0 < Car().hold(20.0) < Car().hold(30.0) < 25.0
        True
        """
        wanted = (self.rolling + self.drag * (v + self.headwind) ** 2) / self.gain
        return float((wanted * MAP_CENTRE**self.curvature) ** (1.0 / (1.0 + self.curvature)))


def draw_car(rng: np.random.Generator) -> Car:
    """Draw a car: its mass, its engine, its brakes."""
    return Car(
        gain=rng.uniform(0.028, 0.040),
        brake=rng.uniform(0.11, 0.16),
        rolling=rng.uniform(0.13, 0.2),
        drag=rng.uniform(2.6e-4, 3.8e-4),
        first_lag=rng.uniform(0.06, 0.14),
        second_lag=rng.uniform(0.15, 0.3),
        brake_lag=rng.uniform(0.1, 0.2),
        curvature=rng.uniform(0.01, 0.05),
        engine_braking=rng.uniform(0.06, 0.14),
    )


# (throttle %, brake m/s², slope %, wind m/s, speed m/s, engaged) -> acceleration m/s²
Accelerate = Callable[[float, float, float, float, float, bool], float]


def accelerate(car: Car, v: float, dt: float) -> Accelerate:
    """Start a car at speed v; each call is one step of `dt` and returns the mean acceleration over it.

    The lags step semi-implicitly, the speed by Heun's rule: the mean of the slopes at both ends.
    """
    first = second = car.hold(v) * (car.hold(v) / MAP_CENTRE) ** car.curvature
    braked = 0.0
    into, out, grip = dt / (car.first_lag + dt), dt / (car.second_lag + dt), dt / (car.brake_lag + dt)
    # m/s; the torque changes over this range about a shift
    width = 0.5

    def step(throttle: float, brake: float, slope: float, wind: float, speed: float, engaged: bool) -> float:
        nonlocal first, second, braked
        command = throttle * (max(throttle, 0.01) / MAP_CENTRE) ** car.curvature
        first += (command - first) * into
        if car.turbo_lag > 0.0:  # the charger spins up the slower the less gas it gets
            lag = car.second_lag + car.turbo_lag * (1.0 - switch(second - 12.0, 3.0))
            second += (first - second) * dt / (lag + dt)
        else:
            second += (first - second) * out
        braked += (brake - braked) * grip
        push = car.gain * second
        if car.gear_ratio != 0.0:
            # gears below the middle one pull more, those above less
            push *= 1.0 - car.gear_ratio * (sum(switch(speed - s, width) for s in SHIFTS) - 2.5)
        push -= car.engine_braking * math.exp(-max(second, 0.0) / 2.0) * speed / (speed + 4.0)
        if not engaged:
            push = 0.0
        fixed = braked + car.rolling + GRAVITY * slope / 100.0
        slopes = 0.0
        end = speed
        for _ in (0, 1):
            power = car.power_limit / max(end, 2.0)
            air = end + wind
            a = (below(push, power, 0.1) if push > 0.0 else push) - fixed - car.drag * air * abs(air)
            slopes += 0.5 * a
            end = speed + dt * a
        return slopes

    return step
