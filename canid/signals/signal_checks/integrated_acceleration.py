"""Change of the own speed against the integral of its acceleration: regression both ways, as either is noisy.

As in `gap_and_range_rate`, the difference of two block means is a weighted integral (mean_difference.py). A slope of the
road or an offset of the sensor moves the acceleration slowly: means are removed. While the acceleration stands at its
largest or smallest value so far it may be limited, and the speed changes by more: such seconds are not compared.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from canid.signals.signal_checks.blocks import ACCEL, SPEED, AtEnd, Block, at_end
from canid.signals.signal_checks.check import Check, Found, unit_of
from canid.signals.signal_checks.mean_difference import integrals
from canid.values.state_constraints import TIME
from canid.values.types import NAN

# pairs of seconds that are kept, and needed
KEPT, NEEDED = 60, 30
# pairs between two judgements
JUDGED_EVERY = 5
# m/s per s rms; less movement is noise and slopes
MIN_MOVEMENT = 0.15
# correlation from which on the two are one quantity up to its scale
ONE_QUANTITY = 0.8
# of acceleration over change of speed: an accelerometer leans with the body by 10 % and is smoothed
RIGHT_SCALE = (0.7, 1.4)
SIGMAS = 3.7
# m/s per s; the resolution of an acceleration that stands still
STILL = 1e-9


class State(NamedTuple):
    """The latest pairs."""

    last_speed: float = NAN  # m/s, mean of the block before
    last_rise: float = 0.0  # m/s, integral of its acceleration with the weight that rises
    changes: tuple[float, ...] = ()  # m/s, of the speed
    integrals: tuple[float, ...] = ()  # m/s, of the acceleration
    times: tuple[Annotated[float, TIME], ...] = ()
    ends: AtEnd = AtEnd()  # m/s², the acceleration
    fresh: int = 0  # pairs since the last judgement
    found: Found | None = None


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    speed, accel = block.mean[SPEED], block.mean[ACCEL]
    if not (speed == speed and accel == accel):
        return (
            state if state.last_speed != state.last_speed else state._replace(last_speed=NAN)
        ), state.found
    values = block.values[:, ACCEL]
    rise, fall = integrals(values, block.dt)
    ends = at_end(state.ends, values)
    # what stands there for as long as what is judged is dead
    limited = any(0 < each.blocks <= KEPT for each in (ends, state.ends))
    # at standstill nothing is compared
    compared = block.joined and state.last_speed == state.last_speed and not limited
    if compared and max(speed, state.last_speed) > 0.5:
        state = state._replace(
            changes=(*state.changes, speed - state.last_speed)[-KEPT:],
            integrals=(*state.integrals, state.last_rise + fall)[-KEPT:],
            times=(*state.times, block.t)[-KEPT:],
            fresh=state.fresh + 1,
        )
    if state.fresh >= JUDGED_EVERY:
        state = state._replace(fresh=0, found=_judge(state))
    return state._replace(last_speed=speed, last_rise=rise, ends=ends), state.found


def _judge(state: State) -> Found | None:
    n = len(state.changes)
    if n < NEEDED:
        return None
    mean_x, mean_y = sum(state.changes) / n, sum(state.integrals) / n
    xx = yy = xy = 0.0
    for x, y in zip(state.changes, state.integrals, strict=True):
        x, y = x - mean_x, y - mean_y
        xx, yy, xy = xx + x * x, yy + y * y, xy + x * y
    if max(xx, yy) < n * MIN_MOVEMENT**2:
        return None
    since, both = state.times[0], ("speed", "accel")
    moved = f"{math.sqrt(max(xx, yy) / n):.2f} m/s rms from second to second"
    if yy <= n * STILL and n == KEPT:
        says = f"accel is constant at {mean_y:.2f} m/s² while the speed changes by {moved}"
        return Found("accel_dead", ("accel",), since, says, "check which signal accel maps")
    if xx <= n * STILL and n == KEPT:
        says = f"speed is constant at {state.last_speed:.1f} m/s while accel changes it by {moved}"
        return Found("speed_dead", ("speed",), since, says, "check which signal speed maps")
    if not abs(xy) > ONE_QUANTITY * math.sqrt(xx * yy):
        return None
    low, high = sorted((xy / xx, yy / xy))
    wide = SIGMAS * math.sqrt(max(1.0 - xy * xy / (xx * yy), 0.0) / n * yy / xx)
    low, high, ratio = low - wide, high + wide, math.copysign(math.sqrt(yy / xx), xy)
    if low <= RIGHT_SCALE[1] and high >= RIGHT_SCALE[0]:
        return None
    if high < 0.0:
        says = (
            f"accel is negative where the speed grows: {ratio:.2f} [{low:.2f}, {high:.2f}] times its change"
        )
        return Found("accel_sign", ("accel",), since, says, "set scale = -1 at accel")
    of_speed = 1.0 / ratio
    numbers = f"{of_speed:.3g} [{1 / high:.3g}, {1 / low if low > 0.0 else math.inf:.3g}]"
    unit = unit_of(of_speed, 1 / high, 1 / low if low > 0.0 else math.inf)
    says = f"the change of the speed is {numbers} times the integral of accel{f': {unit}?' if unit else ''}"
    name = "speed_unit" if unit else "accel_scale"
    return Found(name, both, since, says, "check the units of speed and accel")


CHECK = Check("integrated_acceleration", init, step)
