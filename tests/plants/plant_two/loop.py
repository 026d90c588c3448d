"""The closed loop: lead, driver with effects and noise, masks, car."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from tests.plants.plant_two.car import BRAKE_PEDAL_BELOW, REVOLUTIONS, SHIFTS, accelerate
from tests.plants.plant_two.driver import answering
from tests.plants.plant_two.plan import STEP_S, Plan, bursts_of, chance, cut_in_at, hung, remnant_of
from tests.plants.plant_two.road import KNOT_SPACING_M, TRAFFIC, hills, wind
from tests.plants.plant_two.shapes import above, switch, window
from tests.plants.planted_drive import Array

# m; bumpers do not pass through each other
TOUCH = 1.0
# %; state-dependent noise: an answer of this size brings as much as the sd that the driver is drawn with, and a
# share of that is there without any answer
ANSWER, QUIETEST = 9.0, 0.3
# s in which the pedal is released and pressed again when gears are shifted, and share of the way at which the
# clutch opens
SHIFT_RAMP, OPENS = 0.12, 0.5
# m/s² on top, of a left foot that rests on the brake
RESTING = 0.4
# Cruise control: 1.6 s behind the lead and 4 m more, 1/s² and 1/s of the errors of gap and speed (ISO 15622 limits the
# acceleration)
BEHIND_LEAD, STANDSTILL, PULL, DAMP = 1.6, 4.0, 0.12, 0.6
HARDEST, FIRMEST = -3.0, 1.5
# The car's emergency brake: m/s², and the gap that it keeps free: m, s at the own speed, s at the closing speed. A linear
# driver who follows a lead at 5 m/s would touch it once in some ten minutes.
EMERGENCY = 4.0
FREE, FREE_OWN, FREE_CLOSING = 1.5, 0.35, 1.0


class Driven(NamedTuple):
    """What the loop leaves behind."""

    columns: dict[str, Array]
    remnant: Array  # (n,) %
    answers: Array  # (n,) %: the driver before the pedal dynamics: neither remnant nor what acts on the pedal


def driven(plan: Plan) -> Driven:
    """Drive a plan. Plain floats in the loop: numpy's scalars are ten times slower."""
    n, driver, car = plan.n, plan.driver, plan.car
    placed = hung(plan)
    answer = answering(driver, placed, STEP_S)
    pedal_effects = [one.touch for one in placed if one.place == "pedal"]
    unit = remnant_of(plan, "own").tolist()
    bursts = bursts_of(plan)
    ahead, ahead_accel = plan.lead_speed.tolist(), plan.lead_accel.tolist()
    gusts = wind(car.headwind, car.gusts, n, STEP_S, chance(plan.seed, "wind")).tolist()
    road = hills(
        car.grade, 1.2 * TRAFFIC[plan.profile].fastest * n * STEP_S, chance(plan.seed, "hills")
    ).tolist()
    cruise = _stretch(plan.stretches("cruise_control"))
    rest = _stretch(plan.stretches("brake_overlap"))
    shift = _shift(plan.stretches("gear_shift"))
    jump, left = cut_in_at(plan)
    grows = plan.noise == "state"

    v = ahead[0]
    level = (car.hold(v) - driver.offset) / driver.K1
    gap = max((driver.headway_desired + max(level, -0.6 * driver.headway_desired)) * v, 3.0)
    move = accelerate(car, v, STEP_S)
    way, a = 0.0, 0.0
    rows = []
    for k in range(n):
        t = k * STEP_S
        if k == jump:
            gap = max(gap * left, 3.0)
        w = ahead[k] - v
        reply = answer(k, gap, v, w, ahead_accel[k], a)
        noise = driver.noise_sd * (unit[k] if bursts is None else bursts.next(a, ahead_accel[k]))
        if grows:
            noise *= math.hypot(QUIETEST, (reply - driver.offset) / ANSWER)
        x = reply + noise
        for touch in pedal_effects:
            x = touch(x, k, gap, v, w, ahead_accel[k], a)
        i = min(int(way / KNOT_SPACING_M), len(road) - 2)
        slope = road[i] + (way / KNOT_SPACING_M - i) * (road[i + 1] - road[i])
        on = cruise(t)
        held = shift(t)
        clutch = held < OPENS
        if on:
            accel_wanted = PULL * (gap - STANDSTILL - BEHIND_LEAD * v) + DAMP * w
            accel_wanted = min(max(accel_wanted, HARDEST), FIRMEST)
            throttle = car.hold(v) + accel_wanted / car.gain
            pedal = 0.0
            brake = max(-throttle, 0.0) * car.gain
            throttle = min(max(throttle, 0.0), 100.0)
        else:
            pedal = throttle = min(max(x * held, 0.0), 100.0)
            # below the floor the driver changes to the brake: softly within 1 %
            brake = car.brake * above(BRAKE_PEDAL_BELOW - x, 0.0, 0.2) if x < 0.0 else 0.0
        brake += EMERGENCY * switch(FREE + FREE_OWN * v + FREE_CLOSING * max(-w, 0.0) - gap, 0.25)
        pressed = brake > 0.05
        if rest(t):
            brake, pressed = brake + RESTING, True
        a = move(throttle, brake, slope, gusts[k], v, not clutch)
        rows.append((pedal, v, gap, w, a, pressed, on, clutch, slope, noise, reply))
        faster = max(v + STEP_S * a, 0.2)
        way += 0.5 * STEP_S * (v + faster)
        after = ahead[k + 1] if k + 1 < n else ahead[k]
        gap = max(gap + 0.5 * STEP_S * (w + after - faster), TOUCH)
        v = faster
    table = np.array(rows).T
    return Driven(_columns(table), table[9].copy(), table[10].copy())


def _columns(table: Array) -> dict[str, Array]:
    pedal, speed, gap, rate, accel, brake, cruise, clutch, slope = (row.copy() for row in table[:9])
    n = len(pedal)
    gear = np.searchsorted(np.array(SHIFTS), speed, side="right")
    climbed = np.cumsum(speed * np.sin(np.arctan(slope / 100.0))) * STEP_S
    return {
        "t": np.arange(n) * STEP_S,
        "pedal": pedal,
        "speed": speed,
        "gap": gap,
        "range_rate": rate,
        "accel": accel,
        "brake": brake,
        "lead_valid": np.ones(n),
        "cruise_active": cruise,
        "clutch": clutch,
        "grade": slope,
        "altitude": 180.0 + climbed,
        "gnss_speed": speed.copy(),
        "gear": gear + 1.0,
        "engine_speed": np.maximum(np.array(REVOLUTIONS)[gear] * speed, 850.0),
    }


def _stretch(stretches: Sequence[Sequence[float]]) -> Callable[[float], bool]:
    """Is a time, asked for in order, within one of the stretches?"""
    ahead = list(stretches)

    def within(t: float) -> bool:
        while ahead and t >= ahead[0][1]:
            ahead.pop(0)
        return bool(ahead) and t >= ahead[0][0]

    return within


def _shift(stretches: Sequence[Sequence[float]]) -> Callable[[float], float]:
    """Share of the pedal that is left, at times asked for in order: 0 within a shift."""
    ahead = list(stretches)

    def share(t: float) -> float:
        while ahead and t >= ahead[0][1] + SHIFT_RAMP:
            ahead.pop(0)
        return 1.0 - window(t, ahead[0][0], ahead[0][1], SHIFT_RAMP) if ahead else 1.0

    return share
