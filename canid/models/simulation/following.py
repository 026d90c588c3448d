"""Car following in closed loop: lead, driver with known truth, car."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from canid.models.effects.effect import Effect, Seen, VehicleState
from canid.models.simulation import planted_effects, remnant
from canid.models.simulation.car import GRAVITY, SHIFT_SPEEDS, Car, gearbox, slope_profile
from canid.models.simulation.driver import DriverTruth, answer, draw_driver
from canid.models.simulation.leads import LEADS, speed_profile
from canid.models.simulation.noise import unit_noise
from canid.models.simulation.planted_effects import Planted, Strength
from canid.values.types import Array

# s; 100 Hz: ten times finer than the estimators' grid, so that no result rests on the simulator's own steps
DT = 0.01
# m/s; below this a headway (gap / 0) is not meaningful, and the driver keeps the gap as if driving at it
_MIN_SPEED = 2.0
# m; bumpers do not pass through each other
_MIN_GAP = 1.0


class Simulation(NamedTuple):
    """A simulated drive: every quantity as it truly was, without any sensor's noise, and the truth."""

    dt: float  # s
    columns: dict[str, Array]  # "t" and role -> (n,), also "headway", "noise", "demand"
    truth: dict[str, Any]  # can be written as JSON
    seed: int
    measured: Mapping[str, Array] = {}  # role -> (n,) where a sensor reports something else


def follow(
    minutes: float,
    seed: int,
    profile: str,
    noise: str,
    driver: DriverTruth | None,
    lost: Sequence[tuple[float, float]],
    cut_in: float | None,
    grade_sd: float,
    car: Car,
    hide: Mapping[str, Strength],
    catalogue: tuple[Effect, ...],
) -> Simulation:
    """Simulate car following; see `simulate`."""
    n = round(minutes * 60 / DT)
    # One stream of random numbers for each purpose: another kind of noise does not change the road.
    rng = {
        purpose: np.random.default_rng([seed, i])
        for i, purpose in enumerate(("driver", "lead", "pedal", "road"))
    }
    truth = draw_driver(rng["driver"]) if driver is None else driver
    road = LEADS[profile]
    lead = speed_profile(road, n, DT, rng["lead"])
    if math.isnan(truth.offset):
        truth = truth._replace(offset=round(car.hold(float(lead.mean())), 3))
    pedal_noise = unit_noise(noise, n, DT, rng["pedal"])
    profile_lead = lead
    if cut_in is not None:
        after = np.arange(n) * DT - cut_in
        # The vehicle that cuts in comes from a slower lane: 1.5 m/s slower, and has the lead's speed some 5 s later.
        lead = np.where(after >= 0, lead - 1.5 * np.exp(-np.maximum(after, 0) / 5.0), lead)
    planting_rng, mean = np.random.default_rng([seed, 9]), float(lead.mean())
    planted = planted_effects.plant(hide, n * DT, mean, car.hold(mean), planting_rng, catalogue)
    slope_sd = planted_effects.slope_sd(planted.of("vehicle"), grade_sd)
    grade = slope_profile(n, DT, profile_lead, slope_sd, rng["road"])
    bursts = [
        (placement.effect.remnant, placement.params)
        for placement in planted.of("remnant")
        if placement.effect.remnant
    ]
    stepwise = remnant.stepper(noise, n, DT, np.random.default_rng([seed, 8]), bursts) if bursts else None
    columns = close_loop(
        lead, pedal_noise, grade, truth, car, planted, stepwise, grows=noise == "state", cut_in=cut_in
    )
    columns |= further_signals(columns, grade, rng["road"])
    t = columns["t"]
    valid = np.ones(n)
    for start, stop in lost:
        valid[(t >= start) & (t < stop)] = 0.0
    columns["lead_valid"] = valid
    facts: dict[str, Any] = {
        "task": "car_following",
        "channels": {
            "headway_error": {"K": truth.K1, "tau": truth.tau1, "dead_time": truth.dead_time1},
            "range_rate": {"K": truth.K2, "tau": truth.tau2, "dead_time": truth.dead_time2},
        },
        "headway_desired": truth.headway_desired,
        "offset": truth.offset,
        "noise": {"kind": noise, "sd": truth.noise_sd},
        "profile": profile,
        "seed": seed,
        "minutes": minutes,
        "lost": [list(pair) for pair in lost],
        "cut_in": cut_in,
        "grade_sd": grade_sd,
        "car": car._asdict(),
        "hidden": planted.truth or None,
    }
    return Simulation(DT, columns, facts, seed, planted_effects.measured(planted, columns))


def close_loop(
    lead: Array,
    pedal_noise: Array,
    grade: Array,
    truth: DriverTruth,
    car: Car,
    planted: Planted,
    stepwise: remnant.Step | None,
    *,
    grows: bool = False,
    cut_in: float | None = None,
    begin: tuple[float, float] | None = None,
    error: Callable[[Seen], float] | None = None,
) -> dict[str, Array]:
    """Close the loop. Plain floats: numpy scalars would make it ten times slower.

    Args:
        lead: (n,) m/s.
        pedal_noise: (n,) of variance 1; where there is no `stepwise`.
        grade: (n,) %.
        truth: the driver.
        car: the car.
        planted: effects on driver and car.
        stepwise: noise that follows the accelerations.
        grows: the noise is in proportion to the answer.
        cut_in: s; another vehicle cuts in.
        begin: gap in m and speed in m/s; None: the wanted headway at the lead's speed.
        error: how far the driver is from the wanted gap, s; None: from the wanted headway.

    Returns:
        Columns (n,) by role, and "t", "demand", "headway", "noise".
    """
    n = len(lead)
    first = answer(truth.K1, truth.tau1, truth.dead_time1, DT)
    second = answer(truth.K2, truth.tau2, truth.dead_time2, DT)
    vl, e, slope = lead.tolist(), (pedal_noise * truth.noise_sd).tolist(), (grade * GRAVITY / 100).tolist()
    decay = math.exp(-DT / car.lag)
    v = vl[0] if begin is None else begin[1]
    gap = truth.headway_desired * v if begin is None else begin[0]
    errors: list[float] = []
    rate: list[float] = []
    seen_rate: list[float] = []
    demand, speed, gaps, accel, noise = (np.empty(n) for _ in range(5))
    # what an effect adds goes through the lag and dead time of the answer to range rate
    third = answer(1.0, truth.tau2, truth.dead_time2, DT)
    added: list[float] = []
    in_driver, in_vehicle = planted.of("driver"), planted.of("vehicle")
    move = planted_effects.pedal_dynamics(in_driver, DT)
    lead_accel = np.gradient(lead, DT).tolist()
    y1 = y2 = y3 = 0.0
    drive, brake = max(truth.offset, 0.0), 0.0
    engine = planted_effects.engine(in_vehicle, drive, car.power, decay, DT)
    slope_sd = float(np.std(grade)) or 1.0
    stands = partial(VehicleState, lagged_pedal=0.0, strength=car.power)
    a = 0.0
    cut = -1 if cut_in is None else round(cut_in / DT)
    for k in range(n):
        if k == cut:
            gap *= 0.55  # a gap of 2 s becomes one of 1.1 s: uncomfortable, not dangerous
        headway, closing = gap / max(v, _MIN_SPEED), vl[k] - v
        seen_rate.append(closing)
        then = k
        e_k = headway - truth.headway_desired
        if in_driver or error is not None:
            seen = Seen(k * DT, n * DT, headway, closing, gap, v, lead_accel[k])
            e_k = e_k if error is None else error(seen)
        if in_driver:
            acted = planted_effects.perceive(in_driver, e_k, closing, seen)
            errors.append(acted.e)
            rate.append(acted.w)
            added.append(acted.extra)
            then = max(k - round(acted.later / DT), 0) if acted.later > 0 else k
            y3 = third.step(y3, added, then)
        else:
            errors.append(e_k)
            rate.append(closing)
        if k == 0 and begin is not None:
            # as if what is seen first had always been so
            y1, y2 = errors[0], rate[0]
        y1, y2 = first.step(y1, errors, then), second.step(y2, rate, then)
        answered = truth.K1 * y1 + truth.K2 * y2 + y3
        # State-dependent noise: a pedal that moves more has more noise; of the same size at an answer of 6 %.
        unscaled = e[k] if stepwise is None else truth.noise_sd * stepwise(a, lead_accel[k])
        n_k = unscaled * (0.25 + abs(answered) / 8.0) if grows else unscaled
        u = truth.offset + answered + n_k
        if in_driver:
            u = move(u)
        demand[k], speed[k], gaps[k], noise[k] = u, v, gap, n_k
        pedal, push = min(max(u, 0.0), 100.0), 0.0
        if in_vehicle:
            gear = 1.0 + sum(v >= limit for limit in SHIFT_SPEEDS)
            state = stands(k * DT, pedal, v, slope[k] * 100 / GRAVITY / slope_sd, gear)
            drive, push = engine(pedal, state)
        else:
            drive = decay * drive + (1 - decay) * pedal
        brake = decay * brake + (1 - decay) * max(-u, 0.0)
        a = car.power * drive - car.brake * brake - car.rolling - car.drag * v * v - slope[k] + push
        accel[k] = a
        v_next = max(v + a * DT, 0.0)
        gap = max(gap + 0.5 * DT * (vl[k] - v + vl[min(k + 1, n - 1)] - v_next), _MIN_GAP)
        v = v_next
    return {
        "t": np.arange(n) * DT,
        "demand": demand,
        "pedal": np.clip(demand, 0.0, 100.0),
        "brake": (demand < -1.0).astype(float),  # the switch closes after a little way, 1 % of the pedal's
        "speed": speed,
        "accel": accel,
        "gap": gaps,
        "range_rate": np.array(seen_rate),
        "lead_speed": lead,
        "headway": gaps / np.maximum(speed, _MIN_SPEED),
        "noise": noise,
    }


def further_signals(columns: dict[str, Array], grade: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Compute what else the car measures: slope, course, gears. Nothing feeds back."""
    v, t = columns["speed"], columns["t"]
    zero = np.zeros(len(v))
    # Curves of a country road: up to 3°/s, some 20 s long.
    yaw_rate = (
        math.radians(2.0) * np.sin(2 * math.pi * t / 37.0 + rng.uniform(0, 6.0)) * np.minimum(v / 15.0, 1.0)
    )
    course = np.cumsum(yaw_rate) * DT
    east, north = np.cumsum(v * np.cos(course)) * DT, np.cumsum(v * np.sin(course)) * DT
    gear, engine_speed = gearbox(v)
    return {
        "grade": grade,
        "altitude": 150.0 + np.cumsum(v * grade / 100) * DT,
        "yaw_rate": yaw_rate,
        # One-track model without slip: steering ratio 15, wheelbase 2.7 m.
        "steering_angle": np.degrees(15 * 2.7 * yaw_rate / np.maximum(v, _MIN_SPEED)),
        "lateral_offset": 0.15 * np.sin(2 * math.pi * t / 23.0),
        "east": east,
        "north": north,
        "lat": 46.87 + north / 111_200,
        "lon": 16.85 + east / (111_200 * math.cos(math.radians(46.87))),
        "gnss_speed": v,
        "gear": gear,
        "engine_speed": engine_speed,
        "cruise_active": zero,
        "clutch": zero,
        "accel_command": columns["accel"],
    }
