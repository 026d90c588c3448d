"""Own speed against satellites or wheels: median of the ratio with its distribution-free interval (binomial).

A median, because satellites lag by half a second and lose their fix; the interval from order statistics needs no model of
that (David & Nagaraja 2003, ch. 7.1).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Annotated, NamedTuple

from canid.signals.signal_checks.blocks import GNSS_SPEED, SPEED, WHEEL_SPEED, Block
from canid.signals.signal_checks.check import Check, Found, unit_of
from canid.values.state_constraints import TIME

# ratios that are kept, one a second, and needed
KEPT, NEEDED = 60, 20
# ratios between two judgements
JUDGED_EVERY = 5
# m/s; below it, half a second of lateness in a brisk start is a third of the speed
MIN_SPEED = 5.0
# a speedometer may read up to 10 % too much by law and reads 1 to 4 %; wheel radii change by 0.5 %. Beyond 5 % headways
# and the gain of headway are off by as much
TOLERANCE = 0.05
# of the interval, in standard deviations of a binomial of one half; seconds in a row are alike, so wider than 95 %
SIGMAS = 3.7


class State(NamedTuple):
    """Logarithms of the latest ratios, one a second, and their times."""

    ratios: tuple[float, ...] = ()
    times: tuple[Annotated[float, TIME], ...] = ()
    fresh: int = 0  # ratios since the last judgement
    found: Found | None = None


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(column: int, role: str, state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    own_speed, other = block.mean[SPEED], block.mean[column]
    if own_speed == own_speed and other > 0.0 and max(own_speed, other) > MIN_SPEED:
        # a speed of 0 while the other one runs is a ratio as well
        ratios = (*state.ratios, math.log(max(own_speed, 0.01) / other))[-KEPT:]
        state = State(ratios, (*state.times, block.t)[-KEPT:], state.fresh + 1, state.found)
        if state.fresh >= JUDGED_EVERY:
            state = state._replace(fresh=0, found=_judge(state, role))
    return state, state.found


def _judge(state: State, role: str) -> Found | None:
    ratios = sorted(state.ratios)
    n = len(ratios)
    if n < NEEDED:
        return None
    reach = int(0.5 * SIGMAS * math.sqrt(n)) + 1
    low, middle, high = ratios[max(n // 2 - reach, 0)], ratios[n // 2], ratios[min(n // 2 + reach, n - 1)]
    tolerance = math.log(1.0 + TOLERANCE)
    if low <= tolerance and high >= -tolerance:
        return None
    a, b, c = (math.exp(x) for x in (middle, low, high))
    unit = unit_of(a)
    says = f"speed is {a:.3g} [{b:.3g}, {c:.3g}] times {role}{f': {unit}?' if unit else ''}"
    remedy = f"check the unit, scale and signal of speed and {role}"
    return Found("speed_unit" if unit else "speed_scale", ("speed", role), state.times[0], says, remedy)


def check(column: int, role: str) -> Check:
    """Make the check against one reference."""
    stepped: Callable[[State, Block], tuple[State, Found | None]] = partial(step, column, role)
    return Check(f"speed_and_{role}", init, stepped)


CHECKS = (check(GNSS_SPEED, "gnss_speed"), check(WHEEL_SPEED, "wheel_speed"))
