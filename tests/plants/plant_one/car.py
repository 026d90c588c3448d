"""The car: engine and brake with lags, drag, rolling, slope; and what may be amiss between pedal and speed."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

GRAVITY = 9.81  # m/s²
# m/s at which the gearbox changes up, and rpm per m/s in each gear
SHIFT = (5.0, 9.0, 14.0, 20.0, 27.0)
RPM = (380.0, 215.0, 140.0, 105.0, 82.0, 68.0)
IDLE = 750.0  # rpm
BRAKE_LAG = 0.15  # s
MAX_BRAKE_M_S2 = 9.0  # m/s²; dry road

# hard forms of the effects
ENGINE_BRAKING_PEDAL = 2.0  # % of pedal below which the engine brakes
BOOST_RPM = 2000.0  # rpm above which a turbocharger is there at once
MIDDLE_GEAR, GEAR_SPREAD = 3.5, 2.5  # of six gears
MAP_NEUTRAL_PEDAL = 20.0  # % at which a curved pedal gives what a straight one gives


class Car(NamedTuple):
    """A car's numbers; 7 to 16 % of pedal hold 28 m/s."""

    power: float  # m/s² per % of pedal
    brake: float  # m/s² per % below the floor
    slack: float  # % below the floor before the brake bites: the way between the pedals
    lag: float  # s, of the engine
    rolling: float  # m/s², with what the driveline takes
    drag: float  # 1/m
    grade_sd: float  # %
    gust_sd: float  # m/s²; wind and bumps

    def hold(self, v: float) -> float:
        """Pedal in % that holds v m/s on a level road.

        >>> Car(0.04, 0.12, 2.0, 0.4, 0.2, 3e-4, 0.0, 0.0).hold(20.0)
        8.0
        """
        return (self.rolling + self.drag * v * v) / self.power


def draw(rng: np.random.Generator) -> Car:
    """Draw a plausible car. The road is level for every third seed."""
    car = Car(
        power=rng.uniform(0.036, 0.050),
        brake=rng.uniform(0.10, 0.16),
        slack=rng.uniform(0.5, 2.5),
        lag=rng.uniform(0.2, 0.6),
        rolling=rng.uniform(0.20, 0.35),
        drag=rng.uniform(2.0e-4, 3.0e-4),
        grade_sd=rng.uniform(0.3, 1.5),
        gust_sd=rng.uniform(0.02, 0.07),
    )
    return car._replace(grade_sd=0.0) if rng.uniform() < 1 / 3 else car


class Motion(NamedTuple):
    """What the car's next step depends on."""

    v: float  # m/s
    engine: float  # % of pedal that the engine has taken up
    actuator: float  # % that reaches the engine
    boost: float  # % with the turbocharger's lag
    brake: float  # % of brake


# state, pedal %, brake % (0 and more), coupled 0/1, slope %, gust m/s² -> next state, acceleration m/s²
Step = Callable[[Motion, float, float, float, float, float], tuple[Motion, float]]


def gear_at(v: float) -> int:
    """Gear of the automatic gearbox, 1 to 6.

    >>> gear_at(3.0), gear_at(30.0)
    (1, 6)
    """
    return bisect_right(SHIFT, v) + 1


def begin(v: float, pedal: float) -> Motion:
    """Return the car that has driven so for a while."""
    return Motion(v, pedal, pedal, pedal, 0.0)


def mover(car: Car, effects: Mapping[str, Mapping[str, float]], h: float) -> Step:
    """Make the car's step of h seconds: exact lags for a pedal held over it, Heun for the speed.

    Effects: headwind(speed m/s) adds to the speed that drag sees. engine_braking(strength m/s²) slows where the pedal is
    below 2 %. power_limit(power m²/s³ = W/kg): propulsion ≤ power / v. gear_ratio(share): propulsion times
    1 + share·(3.5 − gear)/2.5. turbo_lag(tau s): a further lag below 2000 rpm. pedal_map(curvature): the engine gets
    p + curvature·p·(p − 20)/20. actuator_lag(tau s): a lag before the engine's.
    """
    wind = effects.get("headwind", {}).get("speed", 0.0)
    resting = effects.get("engine_braking", {}).get("strength", 0.0)
    most = effects.get("power_limit", {}).get("power", math.inf)
    ratio = effects.get("gear_ratio", {}).get("share", 0.0)
    curve = effects.get("pedal_map", {}).get("curvature", 0.0)
    turbo = "turbo_lag" in effects
    late = "actuator_lag" in effects
    power, weight, rolling, drag = car.power, car.brake, car.rolling, car.drag
    engine_keep, brake_keep = math.exp(-h / car.lag), math.exp(-h / BRAKE_LAG)
    turbo_keep = math.exp(-h / effects["turbo_lag"]["tau"]) if turbo else 0.0
    late_keep = math.exp(-h / effects["actuator_lag"]["tau"]) if late else 0.0

    def resist(v: float) -> float:
        through = v + wind
        return rolling + drag * through * abs(through)

    def push(torque: float, v: float) -> float:
        a = power * torque
        if ratio:
            a *= 1.0 + ratio * (MIDDLE_GEAR - gear_at(v)) / GEAR_SPREAD
        return a if a * v <= most else most / v

    def step(
        x: Motion, pedal: float, brake: float, coupled: float, slope: float, gust: float
    ) -> tuple[Motion, float]:
        v = x.v
        asked = pedal + curve * pedal * (pedal - MAP_NEUTRAL_PEDAL) / MAP_NEUTRAL_PEDAL if curve else pedal
        actuator = asked + late_keep * (x.actuator - asked)
        engine = actuator + engine_keep * (x.engine - actuator)
        before, torque, boost = x.engine, engine, engine
        if turbo:
            low = RPM[gear_at(v) - 1] * v < BOOST_RPM
            boost = engine + turbo_keep * (x.boost - engine) if low else engine
            before, torque = x.boost, boost
        pressed = brake + brake_keep * (x.brake - brake)
        slow = GRAVITY * 0.01 * slope - gust + (resting if pedal < ENGINE_BRAKING_PEDAL and coupled else 0.0)
        a0 = coupled * push(before, v) - min(weight * x.brake, MAX_BRAKE_M_S2) - resist(v) - slow
        there = max(v + h * a0, 0.0)
        a1 = coupled * push(torque, there) - min(weight * pressed, MAX_BRAKE_M_S2) - resist(there) - slow
        a = 0.5 * (a0 + a1)
        return Motion(max(v + h * a, 0.0), engine, actuator, boost, pressed), a

    return step
