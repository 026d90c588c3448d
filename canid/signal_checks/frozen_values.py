"""Exact repeats of a value that must move: a hung sender repeats itself, a sensor with noise does not.

A value must move where another signal says so, or where it has never stood still before for a sixth as long. What is held
for a part of a second and then jumps is late by half of that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from canid.signal_checks.blocks import ACCEL, GAP, PEDAL, RANGE_RATE, SPEED, Block
from canid.signal_checks.check import Check, Found
from canid.state_constraints import TIME
from canid.types import NAN

# column -> role, and the smallest jump after a held value that is no step of a coarse signal: such steps are 0.05 to 0.25
WATCHED = {GAP: ("gap", 1.0), RANGE_RATE: ("range_rate", 0.4), SPEED: ("speed", 0.4)}
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
# times the longest repeat so far, and blocks of moving values after which that is known
UNUSUAL_FACTOR, KNOWN_BLOCKS = 6, 60
# s; an unusual repeat that nothing else contradicts
MIN_UNUSUAL_S = 8.0
# samples of a held value; seconds with such a jump that are needed, and s in which they are counted
HELD_SAMPLES, NEEDED_JUMPS, JUMP_SPAN_S = 3, 10, 40.0


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
    jumps: tuple[Annotated[float, TIME], ...] = ()  # s, of the blocks in which it jumped after a held value


class State(NamedTuple):
    """By role."""

    watched: Mapping[str, Watch] = {}
    pedal: tuple[float, float] = (0.0, 0.0)  # %, smallest and largest since the speed has stood still


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    watched, found = dict(state.watched), None
    pedal = state.pedal
    for column, (role, jump) in WATCHED.items():
        of = watched.get(role, Watch())
        spread = block.spread[column]
        if spread > 0.0 and spread <= jump and not of.run and not of.jumps:  # the usual case
            watched[role] = of._replace(moving=of.moving + 1)
            continue
        still = block.spread[column] == 0.0 and _may_move(column, block)
        if still and of.run == 0:
            of = of._replace(
                begin=max(block.t - 1.0, 0.0), value=block.mean[column], way=0.0, low=0.0, high=0.0
            )
            pedal = (block.mean[PEDAL], block.mean[PEDAL]) if column == SPEED else pedal
        if still and abs(block.mean[column] - of.value) < 1e-9:
            of = _still(of, column, block)
            if column == SPEED:
                pedal = min(pedal[0], block.mean[PEDAL]), max(pedal[1], block.mean[PEDAL])
        else:
            usual = of.usual if _says(of, role, pedal) else max(of.usual, of.run)
            of = of._replace(run=0, usual=usual, moving=of.moving + (block.spread[column] > 0.0))
        of = _jumps(of, column, jump, block)
        watched[role] = of
        says = _says(of, role, pedal)
        if says and found is None:
            remedy = f"its sender repeats itself: leave this part out, and check the source of {role}"
            found = Found(f"{role}_frozen", (role,), of.begin, says, remedy)
        elif found is None and len(of.jumps) >= NEEDED_JUMPS:
            says = (
                f"{role} repeats values and jumps: in {len(of.jumps)} of {JUMP_SPAN_S:.0f} s after {HELD_SAMPLES} or "
                "more equal samples"
            )
            remedy = f"its source is slower than its message: dead times are off by half of the hold; map another {role}"
            found = Found(f"{role}_repeated", (role,), of.jumps[0], says, remedy)
    return State(watched, pedal), found


def _may_move(column: int, block: Block) -> bool:
    """At standstill and without a lead a constant is right."""
    return block.mean[SPEED] > 2.0 if column == SPEED else block.follows


def _still(of: Watch, column: int, block: Block) -> Watch:
    """One more block without a movement: follow what another signal says meanwhile."""
    n = block.dt * len(block.values)
    other = {GAP: RANGE_RATE, SPEED: ACCEL}.get(column)
    if other is not None:
        change = block.mean[other] * n
        way = of.way + (change if change == change else 0.0)
    else:
        # the gap, less what this range rate means
        gap = block.mean[GAP]
        way = gap - of.value * (of.run + 0.5) * n
        if of.run == 0:
            return of._replace(run=1, way=way, low=way, high=way)
    return of._replace(run=of.run + 1, way=way, low=min(of.low, way), high=max(of.high, way))


def _says(of: Watch, role: str, pedal: tuple[float, float]) -> str:
    """What speaks against a constant value; "": nothing."""
    if of.run < MIN_FREEZE_S:
        return ""
    span, unit = of.high - of.low, "m" if role == "gap" else "m/s"
    begins = f"{role} has been {of.value:.4g} {unit} for {of.run} s"
    if role == "gap" and span > MIN_GAP_CHANGE_M + HALF_STEP * of.run:
        return f"{begins} although range rate changes it by {span:.1f} m"
    if role == "range_rate" and span > MIN_GAP_CHANGE_M + HALF_STEP * of.run:
        return f"{begins} although the gap departs from it by {span:.1f} m"
    if role == "speed" and span > MIN_SPEED_CHANGE + ACCEL_OFFSET * of.run:
        return f"{begins} although accel changes it by {span:.1f} m/s"
    if role == "speed" and of.run >= PEDAL_FREEZE_S and pedal[1] - pedal[0] > MIN_PEDAL_CHANGE:
        return f"{begins} although the pedal moves by {pedal[1] - pedal[0]:.0f} %"
    unusual = of.moving >= KNOWN_BLOCKS and of.run >= max(MIN_UNUSUAL_S, UNUSUAL_FACTOR * (of.usual + 1))
    return f"{begins}, never more than {of.usual} s before" if unusual else ""


def _jumps(of: Watch, column: int, jump: float, block: Block) -> Watch:
    """Note whether the value jumps after it was held."""
    jumps = of.jumps
    if block.spread[column] > jump and _may_move(column, block):
        held = 0
        for size in np.diff(block.values[:, column]).tolist():
            if size == 0.0:
                held += 1
                continue
            if held >= HELD_SAMPLES - 1 and abs(size) > jump:
                jumps = (*jumps, block.t)
                break
            held = 0
    if jumps and jumps[0] <= block.t - JUMP_SPAN_S:
        jumps = jumps[1:]
    return of._replace(jumps=jumps)


CHECK = Check("frozen_values", init, step)
