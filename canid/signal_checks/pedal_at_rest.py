"""A pedal that nobody presses must be released: while the brake works, or cruise control drives.

A throttle plate is opened by cruise control and by the idle controller too, and so is never at rest.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from canid.signal_checks.blocks import BRAKE, CRUISE, PEDAL, SPEED, Block
from canid.signal_checks.check import Check, Found
from canid.state_constraints import TIME
from canid.types import NAN

# seconds at rest that are kept, and needed
KEPT, NEEDED = 60, 10
# %; one step of an 8-bit sensor is 0.4: a released pedal shows less
RELEASED_PERCENT = 1.0
# of the seconds at rest: a person overrides cruise control, or brakes with the left leg, for less of the time
MIN_SHARE = 0.8
# m/s²; engine drag slows a car by 1 at most, more is the brake
BRAKING = 1.5
# blocks after cruise control takes over in which the driver may still press the pedal
SETTLED_BLOCKS = 2


class State(NamedTuple):
    """Mean pedal of the latest seconds at rest."""

    pedals: tuple[float, ...] = ()
    times: tuple[Annotated[float, TIME], ...] = ()
    resting: int = 0  # blocks of cruise control
    last_speed: float = NAN  # m/s


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    pedal, speed = block.mean[PEDAL], block.mean[SPEED]
    braked = block.mean[BRAKE] == 1.0 or (block.joined and speed - state.last_speed < -BRAKING)
    resting = state.resting + 1 if block.mean[CRUISE] == 1.0 else 0
    state = state._replace(resting=resting, last_speed=speed)
    if (braked or resting > SETTLED_BLOCKS) and pedal == pedal:
        state = state._replace(pedals=(*state.pedals, pedal)[-KEPT:], times=(*state.times, block.t)[-KEPT:])
    return state, _judge(state)


def _judge(state: State) -> Found | None:
    n = len(state.pedals)
    if n < NEEDED:
        return None
    pressed = [pedal for pedal in state.pedals if pedal > RELEASED_PERCENT]
    if len(pressed) < MIN_SHARE * n:
        return None
    ordered = sorted(state.pedals)
    says = (
        f"the pedal is not at rest in {len(pressed)} of {n} s in which the brake or cruise control works: "
        f"median {ordered[n // 2]:.1f} %, {ordered[n // 20]:.1f} to {ordered[n - 1 - n // 20]:.1f} %"
    )
    remedy = "it may be a throttle, or have an offset: map the accelerator pedal, or set its offset"
    return Found("pedal_is_throttle", ("pedal",), state.times[0], says, remedy)


CHECK = Check("pedal_at_rest", init, step)
