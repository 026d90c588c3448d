"""A pedal that nobody presses must be released: while the brake works, or cruise control drives.

A throttle plate is opened by cruise control and by the idle controller too, and so is never at rest.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from canid.signals.signal_checks.blocks import BRAKE, CRUISE, PEDAL, SPEED, Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.types import NAN

# seconds at rest that are kept, and needed
KEPT, NEEDED = 60, 10
# %; one step of an 8-bit sensor is 0.4: a released pedal shows less
RELEASED_PERCENT = 1.0
# of the seconds at rest: a person overrides cruise control, or brakes with the left leg, for less of the time
MIN_SHARE = 0.8
# m/s²; drag and a slope of 5 % slow a car with a pedal that is hardly pressed by 0.9. On 24 simulated drives and in the
# measured logs the pedal was pressed in less than a fifth of the seconds that slowed the car by more than 1
BRAKING = 1.2
# samples of the brake after which the pedal is released, in one block
BRAKED_SAMPLES = 3
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
    slows = block.joined and speed - state.last_speed < -BRAKING
    resting = state.resting + 1 if block.mean[CRUISE] == 1.0 else 0
    state = state._replace(resting=resting, last_speed=speed)
    rests = slows or resting > SETTLED_BLOCKS
    if not rests and block.mean[BRAKE] > 0.0:
        pedal, rests = _while_braking(block)
    if rests and pedal == pedal:
        state = state._replace(pedals=(*state.pedals, pedal)[-KEPT:], times=(*state.times, block.t)[-KEPT:])
    return state, _judge(state)


def _while_braking(block: Block) -> tuple[float, bool]:
    """Mean pedal of the samples in which the brake has been pressed for `BRAKED_SAMPLES`, %; and whether there are any."""
    pressed, pedals = 0, []
    for brake, pedal in block.values[:, (BRAKE, PEDAL)].tolist():
        pressed = pressed + 1 if brake == 1.0 else 0
        if pressed >= BRAKED_SAMPLES:
            pedals.append(pedal)
    return (sum(pedals) / len(pedals), True) if pedals else (NAN, False)


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
