"""Lane keeping in closed loop: the ARMAX steering driver of Chen & Ulsoy 2001 and a one-track car."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.models.effects.effect import Effect
from canid.models.simulation import lane_effects, planted_effects
from canid.models.simulation.car import Car, gearbox, slope_profile
from canid.models.simulation.following import DT, Simulation
from canid.models.simulation.planted_effects import Strength
from canid.values.types import Array


class Steering(NamedTuple):
    """A(q) angle = B(q) offset + C(q) e at 10 Hz (Chen & Ulsoy 2001, eq. 1 and 3).

    Defaults: the means of their Table 1, one driver. Their input is the error, canid's is the offset from
    the lane's middle, positive to the left as the angle is: a driver who keeps the lane has the other sign.
    """

    a: tuple[float, float] = (-1.2623, 0.3697)
    b: tuple[float, float] = (-4.1340, 4.0337)  # ° per m
    c: float = 0.3  # the paper does not state it: a middling moving average
    noise_sd: float = 0.25  # °, of e


# Samples of the driver's 0.1 s that the loop makes in one.
_STEPS = 10
_SPEED = 25.0  # m/s, where Table 1's driver keeps the lane with a phase margin of some 40°
_RATIO, _WHEELBASE = 15.0, 2.7  # steering ratio and m, a middle-class car
_YAW_LAG = 0.15  # s, how a car's yaw rate follows its wheels at that speed
# m/s² and s: what wind and road push to the side; moves the car by some 0.4 m
_PUSH, _PUSH_TIME = 0.25, 0.5
# s, for which one driver of a schedule steers: the segments of Chen & Ulsoy 2001
_SCHEDULE_S = 60.0


# 1/m, standard deviation of the road's curvature where an effect needs curves: a degree of steering wheel
_CURVES = 4e-4
_CURVE_LENGTHS = (150.0, 600.0)  # m, from one left curve to the next


def keep_lane(
    minutes: float,
    seed: int,
    steering: Steering,
    car: Car,
    hide: Mapping[str, Strength],
    catalogue: tuple[Effect, ...],
    curvature_sd: float = 0.0,
    schedule: Sequence[Steering] = (),
    push_sd: float = _PUSH,
) -> Simulation:
    """Simulate lane keeping at 25 m/s.

    The wheel turns evenly between the driver's decisions, so that the angle at each 0.1 s is exactly the
    model's output.

    Args:
        minutes: duration.
        seed: the same seed gives the same drive.
        steering: the driver.
        car: of the pedal and the gearbox.
        hide: effects of the driver, as in `simulate`.
        catalogue: effects that may be hidden.
        curvature_sd: standard deviation of the road's curvature, 1/m; 0: straight, or as an effect needs it.
        schedule: drivers of one minute each, the last one to the end; empty: `steering` all along.
        push_sd: what wind and road push to the side, standard deviation in m/s².

    Example:
        >>> drive = keep_lane(1.0, 1, Steering(), Car(), {}, ())
        >>> bool(abs(drive.columns["lateral_offset"]).max() < 1.5)
        True
    """
    n = round(minutes * 60 / DT)
    planting_rng = np.random.default_rng([seed, 9])
    planted = planted_effects.plant(hide, n * DT, _SPEED, car.hold(_SPEED), planting_rng, catalogue)
    see = lane_effects.sight(planted.placed, n * DT, _STEPS * DT, DT)
    move = planted_effects.pedal_dynamics(planted.placed, _STEPS * DT)
    sd = curvature_sd or (_CURVES if lane_effects.in_curves(planted.placed) else 0.0)
    # four waves of curves, as hills are made
    curvature = slope_profile(n, DT, np.full(n, _SPEED), sd, np.random.default_rng([seed, 2]), _CURVE_LENGTHS)
    bends: list[float] = curvature.tolist()

    def bend(t: float) -> float:
        return bends[min(max(round(t / DT), 0), n - 1)]

    pedal, road = np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1])
    drivers = tuple(schedule) or (steering,)
    per_driver = round(_SCHEDULE_S / (_STEPS * DT))  # decisions

    def driver_at(decision: int) -> Steering:
        return drivers[min(decision // per_driver, len(drivers) - 1)]

    noise_sd = np.array([driver_at(j).noise_sd for j in range(n // _STEPS + 2)])
    e = (noise_sd * pedal.standard_normal(n // _STEPS + 2)).tolist()
    decay = math.exp(-DT / _PUSH_TIME)
    shocks = (push_sd * math.sqrt(1 - decay * decay) * road.standard_normal(n)).tolist()
    angle, yaw_rate = np.empty(n), np.empty(n)
    y = heading = drift = r = push = 0.0
    offset: list[float] = []
    turned = [0.0, 0.0]  # the last two angles that the driver wanted
    now = next_angle = aimed = 0.0
    for k in range(n):
        j, part = divmod(k, _STEPS)
        offset.append(y)
        if part == 0:
            now = next_angle
            turned = [aimed, turned[0]]
            driver = driver_at(j + 1)
            # nk = 1: the angle at the next decision rests on the offsets of this one and the one before.
            seen, added = see((j + 1) * _STEPS * DT, offset, bend)
            aimed = (
                -driver.a[0] * turned[0]
                - driver.a[1] * turned[1]
                + driver.b[0] * seen[0]
                + driver.b[1] * seen[1]
                + e[j + 1]
                + driver.c * e[j]
                + (1.0 + sum(driver.a)) * added
            )
            next_angle = move(aimed)
        yaw_rate[k] = r
        angle[k] = now + (next_angle - now) * part / _STEPS
        wanted = _SPEED * math.radians(angle[k]) / (_RATIO * _WHEELBASE)
        r += (wanted - r) * DT / _YAW_LAG
        heading += (r - _SPEED * bends[k]) * DT
        push = decay * push + shocks[k]
        drift += push * DT
        # Tyres do not let a car slide sideways for long: what pushed it has gone after half a second.
        drift -= drift * DT / _PUSH_TIME
        y += (_SPEED * heading + drift) * DT
    facts = _truth(minutes, seed, steering) | {"hidden": planted.truth or None}
    if schedule:
        facts["schedule"] = [entry._asdict() for entry in drivers]
    columns = _columns(n, np.array(offset), angle, yaw_rate, car) | {"curvature": curvature}
    return Simulation(DT, columns, facts, seed)


def _columns(n: int, offset: Array, angle: Array, yaw_rate: Array, car: Car) -> dict[str, Array]:
    speed, zero = np.full(n, _SPEED), np.zeros(n)
    gear, engine_speed = gearbox(speed)
    switches = dict.fromkeys(("lead_valid", "brake", "cruise_active", "clutch"), zero)
    return {
        "t": np.arange(n) * DT,
        "lateral_offset": offset,
        "steering_angle": angle,
        "yaw_rate": yaw_rate,
        "speed": speed,
        "gnss_speed": speed,
        "accel": zero,
        "pedal": np.full(n, car.hold(_SPEED)),
        "gear": gear,
        "engine_speed": engine_speed,
        **switches,
    }


def _truth(minutes: float, seed: int, steering: Steering) -> dict[str, Any]:
    gain = sum(steering.b) / (1 + sum(steering.a))
    return {
        "task": "lane_keeping",
        "channels": {"lateral_offset": {"K": gain}},  # of second order: no one lag, no one dead time
        "armax": {
            "dt": _STEPS * DT,
            "A": [1.0, *steering.a],
            "B": {"lateral_offset": list(steering.b)},
            "C": [1.0, steering.c],
            "nk": 1,
        },
        "noise": {"kind": "armax", "sd": steering.noise_sd},
        "profile": "lane",
        "seed": seed,
        "minutes": minutes,
        "hidden": None,
    }
