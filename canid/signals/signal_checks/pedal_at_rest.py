"""A pedal that nobody presses must be released: while the brake works, or cruise control drives.

A throttle plate is opened by cruise control and by the idle controller too, and so is never at rest. Where no brake is
measured, a car that slows quickly is taken to be braked, unless the pedal explains it: a motor that recovers energy slows
the car as well.
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
# of the slowing; the rest follows from the pedal, by the line through acceleration and pedal of the other seconds. Of motors
# that brake it was 0 to 0.42 on 12 drives with slopes of up to 4 %, of a brake 0.57 to 0.84 on 12 with a throttle
UNEXPLAINED_SHARE = 0.5
# samples of the brake after which the pedal is released, in one block
BRAKED_SAMPLES = 3
# blocks after cruise control takes over in which the driver may still press the pedal
SETTLED_BLOCKS = 2


class Slowing(NamedTuple):
    """A second without a brake signal in which the car slows quickly."""

    t: Annotated[float, TIME]  # s
    pedal: float  # %
    accel: float  # m/s², from the second before to this one
    pressed: float  # %, mean pedal of both


class Driven(NamedTuple):
    """Sums over the other seconds without a brake signal, of what the line through acceleration and pedal needs."""

    n: float = 0.0
    accel: float = 0.0
    pressed: float = 0.0
    square: float = 0.0  # of the pedal
    product: float = 0.0


class State(NamedTuple):
    """Mean pedal of the latest seconds at rest."""

    pedals: tuple[float, ...] = ()
    times: tuple[Annotated[float, TIME], ...] = ()
    resting: int = 0  # blocks of cruise control
    last_speed: float = NAN  # m/s
    last_pedal: float = NAN  # %
    slowing: tuple[Slowing, ...] = ()
    driven: Driven = Driven()


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    pedal, speed = block.mean[PEDAL], block.mean[SPEED]
    accel, pressed = speed - state.last_speed, 0.5 * (state.last_pedal + pedal)
    resting = state.resting + 1 if block.mean[CRUISE] == 1.0 else 0
    state = state._replace(resting=resting, last_speed=speed, last_pedal=pedal)
    rests = resting > SETTLED_BLOCKS
    if not rests and block.mean[BRAKE] > 0.0:
        pedal, rests = _while_braking(block)
    if rests and pedal == pedal:
        state = state._replace(pedals=(*state.pedals, pedal)[-KEPT:], times=(*state.times, block.t)[-KEPT:])
    # a brake's signal says more than the speed
    elif block.mean[BRAKE] != block.mean[BRAKE] and block.joined and accel + pressed == accel + pressed:
        state = _unmeasured(state, Slowing(block.t, pedal, accel, pressed))
    return state, _judge(state)


def _unmeasured(state: State, second: Slowing) -> State:
    """Take a second of which nobody measures whether the brake works."""
    if second.accel < -BRAKING:
        return state._replace(slowing=(*state.slowing, second)[-KEPT:])
    n, accel, pressed, square, product = state.driven
    a, p = second.accel, second.pressed
    return state._replace(driven=Driven(n + 1.0, accel + a, pressed + p, square + p * p, product + p * a))


def _while_braking(block: Block) -> tuple[float, bool]:
    """Mean pedal of the samples in which the brake has been pressed for `BRAKED_SAMPLES`, %; and whether there are any."""
    pressed, pedals = 0, []
    for brake, pedal in block.values[:, (BRAKE, PEDAL)].tolist():
        pressed = pressed + 1 if brake == 1.0 else 0
        if pressed >= BRAKED_SAMPLES:
            pedals.append(pedal)
    return (sum(pedals) / len(pedals), True) if pedals else (NAN, False)


def _braked(slowing: tuple[Slowing, ...], driven: Driven) -> bool:
    """Whether the car is slowed by more than its pedal explains."""
    n, accel, pressed, square, product = driven
    spread = n * square - pressed * pressed
    if len(slowing) < NEEDED or n < NEEDED or not spread > 0.0:
        return False
    per_percent = max((n * product - pressed * accel) / spread, 0.0)
    measured = sum(second.accel for second in slowing)
    at = sum(second.pressed for second in slowing)
    explained = len(slowing) * (accel - per_percent * pressed) / n + per_percent * at
    return measured - explained < UNEXPLAINED_SHARE * measured


def _judge(state: State) -> Found | None:
    braked = state.slowing if _braked(state.slowing, state.driven) else ()
    pedals = [*state.pedals, *(second.pedal for second in braked)]
    n = len(pedals)
    if n < NEEDED:
        return None
    pressed = [pedal for pedal in pedals if pedal > RELEASED_PERCENT]
    if len(pressed) < MIN_SHARE * n:
        return None
    ordered = sorted(pedals)
    says = (
        f"the pedal is not at rest in {len(pressed)} of {n} s in which the brake or cruise control works: "
        f"median {ordered[n // 2]:.1f} %, {ordered[n // 20]:.1f} to {ordered[n - 1 - n // 20]:.1f} %"
    )
    remedy = "it may be a throttle, or have an offset: map the accelerator pedal, or set its offset"
    since = min((*state.times[:1], *(second.t for second in braked[:1])))
    return Found("pedal_is_throttle", ("pedal",), since, says, remedy)


CHECK = Check("pedal_at_rest", init, step)
