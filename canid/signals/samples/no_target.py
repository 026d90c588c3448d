"""Gaps that stand for no vehicle ahead: 0 m at speed, the largest raw value, or a number that stands still like one.

A number that a radar sends without a target is reached by a jump and does not move at all, nor does the range rate, while
the own speed does. One that moves on by a step was a gap: it is forgotten. Without a gap there is no range rate either.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from operator import itemgetter
from typing import NamedTuple

from canid.signals.samples.learning_gate import CREEP_SPEED
from canid.signals.samples.smoothing import MAX_GAP_ERROR, MAX_REPORT_AGE_S
from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.decoding_state import Decoded
from canid.values.types import NAN, Array

# m/s; no lead departs or approaches faster: what changes the gap by more than this and `MAX_GAP_ERROR` is a jump
MAX_RANGE_RATE = 20.0
# s, and m/s by which the own speed changes meanwhile: so long a number without a movement is none. A number beyond all
# gaps so far; and one among them, or the first of a drive, which a lead at the own speed may have for longer
STILL_BEYOND, STILL_AMONG = (3.0, 0.2), (8.0, 1.0)
# reports in that time; fewer come from a slow radar, which repeats little
MIN_REPORTS = 10
# bits of a raw number whose largest value is far from what is measured
MIN_BITS = 6
# roles that count, of one frame in this order
ROLES = ("speed", "lead_valid", "gap", "range_rate")


class State(NamedTuple):
    """The run of equal gaps, and the numbers that have turned out to stand for none."""

    speed: float = NAN  # m/s, own, latest
    rate: float = NAN  # m/s, latest of the run
    gap: float = NAN  # m, of the run; NaN: there is none
    t: float = NAN  # s, of its latest report
    since: float = NAN  # s, of its first report
    reports: int = 0
    jumped: bool = False  # it did not follow from the gap before
    moved: bool = False  # the range rate has, within the run
    slow: float = math.inf  # m/s, smallest and largest own speed within the run
    fast: float = -math.inf
    low: float = math.inf  # m, smallest and largest gap of a vehicle so far
    high: float = -math.inf
    known: frozenset[float] = frozenset()  # m
    none: bool = False  # the latest report was of no vehicle
    flag: float = NAN  # `lead_valid`, latest


def init() -> State:
    """Return the state before the first reading."""
    return State()


def largest_raw(vehicle: Vehicle) -> float:
    """Gap of the largest raw number, m; infinite where it may have been measured, or the gap is made of others.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> round(largest_raw(read_vehicle("generic")), 2)
        409.55
    """
    role = vehicle.roles.get("gap")
    if role is None or role.made or role.how.bits.floating or role.how.bits.length < MIN_BITS:
        return math.inf
    return max(raw * role.how.factor + role.how.offset for raw in role.how.bits.reach)


def step(
    state: State, decoded: Decoded, t: Array, largest: float
) -> tuple[State, Decoded, Mapping[str, int]]:
    """Take a chunk.

    Args:
        state: from `init()` or the chunk before.
        decoded: the chunk's readings.
        t: (n,) s, of its frames.
        largest: gap of the largest raw number, m, from `largest_raw`.

    Returns:
        the state; the readings, with NaN in the place of gaps that stand for no vehicle and of their range rates; and how
        many gaps those were, by sentence.

    Example:
        >>> import numpy as np
        >>> from canid.signals.vehicle.decoding_state import RoleReadings
        >>> rows = np.arange(3)
        >>> gap = RoleReadings("gap", rows, np.array([20.0, 0.0, 21.0]))
        >>> speed = RoleReadings("speed", rows, np.full(3, 25.0))
        >>> _, (roles, *_), counts = step(init(), Decoded((gap, speed), (), ()), 0.1 * rows, math.inf)
        >>> roles[0].value.tolist(), dict(counts)
        ([20.0, nan, 21.0], {'gap: 0 m at speed, no vehicle ahead': 1})
    """
    items = sorted(
        (
            (row, place, k, index, value)
            for place, role in enumerate(ROLES)
            for k, readings in enumerate(decoded.roles)
            if readings.role == role
            for index, (row, value) in enumerate(
                zip(readings.row.tolist(), readings.value.tolist(), strict=True)
            )
        ),
        key=itemgetter(0, 1),
    )
    times, counts = t.tolist(), Counter[str]()
    hidden: dict[int, list[int]] = {}
    # written out: `_replace` takes long, and the own speed comes most often
    speed, slow, fast = state.speed, state.slow, state.fast
    for row, place, k, index, value in items:
        role = ROLES[place]
        if role == "lead_valid":
            state = state._replace(flag=value)
        elif value != value:
            # a hole: the next gap follows from none
            state = state._replace(gap=NAN) if role == "gap" else state
            continue
        elif role == "speed":
            speed, slow, fast = value, min(slow, value), max(fast, value)
        elif role == "gap":
            state = state._replace(speed=speed, slow=slow, fast=fast)
            state, says = _report(state, times[row], value, largest)
            slow, fast = state.slow, state.fast
            if says:
                counts[says] += 1
        elif value != state.rate:
            state = state._replace(rate=value, moved=state.moved or state.rate == state.rate)
        if state.none and role in ("gap", "range_rate"):
            hidden.setdefault(k, []).append(index)
    state = state._replace(speed=speed, slow=slow, fast=fast)
    if not hidden:
        return state, decoded, counts
    roles = list(decoded.roles)
    for k, indices in hidden.items():
        value = roles[k].value.copy()
        value[indices] = NAN
        roles[k] = roles[k]._replace(value=value)
    return state, decoded._replace(roles=tuple(roles)), counts


def _report(state: State, t: float, gap: float, largest: float) -> tuple[State, str]:
    """Take a gap; return what it stands for where it is none."""
    if state.flag == 0.0:
        # whatever the number, it is known not to be measured
        return _left(state)._replace(none=False), ""
    # an own speed that is not known may be any
    if gap <= 0.0 and not state.speed < CREEP_SPEED:
        return _left(state)._replace(none=True), "gap: 0 m at speed, no vehicle ahead"
    if gap >= largest:
        return _left(state)._replace(none=True), f"gap: {gap:.4g} m, the largest raw value, no vehicle ahead"
    if gap == state.gap and t - state.t <= MAX_REPORT_AGE_S:
        state = state._replace(t=t, reports=state.reports + 1)
        if state.jumped and gap not in state.known and _stands_still(state):
            state = state._replace(known=state.known | {gap})
    else:
        # comparisons with NaN are false
        follows = abs(gap - state.gap) <= MAX_GAP_ERROR + MAX_RANGE_RATE * (t - state.t)
        follows &= t - state.t <= MAX_REPORT_AGE_S
        if follows and state.gap in state.known:
            state = state._replace(known=state.known - {state.gap}, none=False)
        known = state.speed == state.speed
        slow, fast = (state.speed, state.speed) if known else (math.inf, -math.inf)
        state = _left(state)._replace(gap=gap, t=t, since=t, reports=1, jumped=not follows)
        state = state._replace(rate=NAN, moved=False, slow=slow, fast=fast)
    none = state.jumped and gap in state.known
    return state._replace(none=none), f"gap: {gap:.4g} m stands still, no vehicle ahead" if none else ""


def _left(state: State) -> State:
    """The run is over; its gap was one, unless it stood for none."""
    if state.none or state.gap != state.gap:
        return state._replace(gap=NAN)
    return state._replace(gap=NAN, low=min(state.low, state.gap), high=max(state.high, state.gap))


def _stands_still(state: State) -> bool:
    """Whether a gap that does not move stands for none."""
    beyond = state.low < math.inf and not state.low < state.gap < state.high
    span, change = STILL_BEYOND if beyond else STILL_AMONG
    # a range rate that is not 0 and stands still with the gap is a radar that hangs
    still = not state.moved and (beyond or state.rate == 0.0 or state.rate != state.rate)
    long = state.t - state.since >= span and state.reports >= MIN_REPORTS
    return still and long and state.fast - state.slow >= change
