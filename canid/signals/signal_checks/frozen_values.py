"""Exact repeats of a value that must move: a hung sender repeats itself, a sensor with noise does not.

A value must move where another signal says so, or where it has never stood still before for a sixth as long. What is held
for a part of a second and then jumps is late by half of that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from canid.signals.signal_checks.blocks import ACCEL, GAP, PEDAL, RANGE_RATE, SPEED, Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.types import NAN

# column -> role
WATCHED = {GAP: "gap", RANGE_RATE: "range_rate", SPEED: "speed"}
# s; shorter repeats are a coarse signal or a steady drive
MIN_FREEZE_S = 3.0
# m of change of the gap that the other signal must contradict: reports have a noise of 0.25 m and steps of 0.1 m
MIN_GAP_CHANGE_M = 2.0
# m/s; half a step of a coarse range rate, which may be off by that for as long as it stands still
HALF_STEP = 0.13
# m/s by which an unchanged speed contradicts the acceleration, in addition to what slopes and its offset explain, m/s²
MIN_SPEED_CHANGE, ACCEL_OFFSET = 1.0, 0.4
# %; a pedal that moves by more, for longer than the next constant, moves the car
MIN_PEDAL_CHANGE, PEDAL_FREEZE_S = 5.0, 15.0
# m/s, a step within which a car stays for 15 s (1 km/h does); steps that show it, and half of the seconds with movement
COARSE_SPEED_STEP, MIN_SPEED_STEPS = 0.25, 3
# times the longest repeat so far, and blocks of moving values after which that is known
UNUSUAL_FACTOR, KNOWN_BLOCKS = 6, 60
# s; an unusual repeat that nothing else contradicts
MIN_UNUSUAL_S = 8.0
# samples of a held value, steps between such values that are kept, and needed; samples by which one follows the other, as
# one may be interpolated: a coarse signal stands still where it turns, and moves in between
HELD_SAMPLES, KEPT_STEPS, NEEDED_STEPS = 3, 24, 16
MAX_APART = HELD_SAMPLES + 1
# times the smallest step: a coarse signal goes from one value to the next, what is held jumps over some
JUMP_FACTOR = 2.5
# of the steps, that must be jumps; and of the samples of a second, that must be repeats
JUMP_SHARE, REPEAT_SHARE = 0.6, 0.5
# of the value; smaller steps are the rounding of the interpolation
ROUNDING = 1e-9


class Watch(NamedTuple):
    """One column."""

    run: int = 0  # blocks in which the value has not moved
    value: float = NAN  # that is repeated
    begin: Annotated[float, TIME] = NAN  # s
    usual: int = 0  # blocks, longest repeat that was found sound
    moving: int = 0  # blocks in which it has moved
    way: float = 0.0  # integral over the run of what should move it
    low: float = 0.0  # smallest and largest of it
    high: float = 0.0
    held: float = NAN  # the last value that was held; NaN: it has moved since
    apart: int = 0  # samples since then
    steps: tuple[float, ...] = ()  # sizes of the latest steps between held values
    first: Annotated[float, TIME] = NAN  # s, of the first of them


class State(NamedTuple):
    """By role."""

    watched: Mapping[str, Watch] = {}
    pedal: tuple[float, float] = (0.0, 0.0)  # %, smallest and largest since the speed has stood still


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    watched, verdict = dict(state.watched), None
    pedal = state.pedal
    for column, role in WATCHED.items():
        watch = watched.get(role, Watch())
        still = block.spread[column] == 0.0 and _may_move(column, block)
        if still and watch.run == 0:
            watch = watch._replace(
                begin=max(block.t - 1.0, 0.0), value=block.mean[column], way=0.0, low=0.0, high=0.0
            )
            pedal = (block.mean[PEDAL], block.mean[PEDAL]) if column == SPEED else pedal
        if still and abs(block.mean[column] - watch.value) < 1e-9:
            watch = _still(watch, column, block)
            if column == SPEED:
                pedal = min(pedal[0], block.mean[PEDAL]), max(pedal[1], block.mean[PEDAL])
        else:
            usual = watch.usual if _says(watch, role, pedal) else max(watch.usual, watch.run)
            watch = watch._replace(run=0, usual=usual, moving=watch.moving + (block.spread[column] > 0.0))
            watch = _held(watch, column, block)
        watched[role] = watch
        says = _says(watch, role, pedal)
        if says and verdict is None:
            remedy = f"its sender repeats itself: leave this part out, and check the source of {role}"
            verdict = Found(f"{role}_frozen", (role,), watch.begin, says, remedy)
        elif verdict is None and _is_held(watch):
            says = (
                f"{role} repeats values and jumps: {len(watch.steps)} steps between values that are held for {HELD_SAMPLES} "
                f"samples or more, {max(watch.steps):.2g} the largest"
            )
            remedy = f"its source is slower than its message, so dead times are off: map another {role}"
            verdict = Found(f"{role}_repeated", (role,), watch.first, says, remedy)
    return State(watched, pedal), verdict


def _may_move(column: int, block: Block) -> bool:
    """At standstill and without a lead a constant is right."""
    return block.mean[SPEED] > 2.0 if column == SPEED else block.follows


def _still(watch: Watch, column: int, block: Block) -> Watch:
    """One more block without a movement: follow what another signal says meanwhile."""
    n = block.dt * len(block.values)
    other = {GAP: RANGE_RATE, SPEED: ACCEL}.get(column)
    if other is not None:
        change = block.mean[other] * n
        way = watch.way + (change if change == change else 0.0)
    else:
        # the gap, less what this range rate means
        gap = block.mean[GAP]
        way = gap - watch.value * (watch.run + 0.5) * n
        if watch.run == 0:
            return watch._replace(run=1, way=way, low=way, high=way)
    return watch._replace(run=watch.run + 1, way=way, low=min(watch.low, way), high=max(watch.high, way))


def _says(watch: Watch, role: str, pedal: tuple[float, float]) -> str:
    """What speaks against a constant value; "": nothing."""
    if watch.run < MIN_FREEZE_S:
        return ""
    span, unit = watch.high - watch.low, "m" if role == "gap" else "m/s"
    begins = f"{role} has been {watch.value:.4g} {unit} for {watch.run} s"
    if role == "gap" and span > MIN_GAP_CHANGE_M + HALF_STEP * watch.run:
        return f"{begins} although range rate changes it by {span:.1f} m"
    if role == "range_rate" and span > MIN_GAP_CHANGE_M + HALF_STEP * watch.run:
        return f"{begins} although the gap departs from it by {span:.1f} m"
    if role == "speed" and span > MIN_SPEED_CHANGE + ACCEL_OFFSET * watch.run:
        return f"{begins} although accel changes it by {span:.1f} m/s"
    # a speed in steps stands still for as long as it is within one, whatever the pedal does
    steps = watch.steps if len(watch.steps) >= MIN_SPEED_STEPS else (0.0,)
    fine = watch.moving >= 2 * MIN_SPEED_STEPS and min(steps) < COARSE_SPEED_STEP
    if role == "speed" and fine and watch.run >= PEDAL_FREEZE_S and pedal[1] - pedal[0] > MIN_PEDAL_CHANGE:
        return f"{begins} although the pedal moves by {pedal[1] - pedal[0]:.0f} %"
    unusual = watch.moving >= KNOWN_BLOCKS and watch.run >= max(
        MIN_UNUSUAL_S, UNUSUAL_FACTOR * (watch.usual + 1)
    )
    return f"{begins}, never more than {watch.usual} s before" if unusual else ""


def _held(watch: Watch, column: int, block: Block) -> Watch:
    """Note the steps between values that are held; a second in which most values are new ends the count."""
    if not _may_move(column, block):
        return watch._replace(held=NAN)
    x = block.values[:, column]
    same = np.concatenate([[False], x[1:] == x[:-1]])
    if np.count_nonzero(same) < REPEAT_SHARE * (len(same) - 1):
        return watch._replace(held=NAN, steps=watch.steps[1:])
    held, apart, steps, first, count = watch.held, watch.apart, watch.steps, watch.first, 0
    for value, repeats in zip(x.tolist(), same.tolist(), strict=True):
        count = count + 1 if repeats else 1
        apart = 0 if value == held else apart + 1
        if count == HELD_SAMPLES:
            if apart <= MAX_APART and abs(value - held) > ROUNDING * (1.0 + abs(value)):
                first = first if steps else block.t
                steps = (*steps, abs(value - held))[-KEPT_STEPS:]
            held, apart = value, 0
    return watch._replace(held=held, apart=apart, steps=steps, first=first)


def _is_held(watch: Watch) -> bool:
    """Whether the steps are jumps over values between them."""
    if len(watch.steps) < NEEDED_STEPS:
        return False
    limit = JUMP_FACTOR * min(watch.steps)
    return sum(step > limit for step in watch.steps) >= JUMP_SHARE * len(watch.steps)


CHECK = Check("frozen_values", init, step)
