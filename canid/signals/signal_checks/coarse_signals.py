"""Range rates and speeds in steps that are large against the movement of the inputs, with no noise that averages over them.

What is rounded stands still and jumps, later than it moves. In steps of 0.5 m/s, with 0.8 m/s of movement, tau came out
0.1 to 0.2 s too long on 10 of 12 drives of 8 min, and with a gap in steps of 1 m as well K of headway error up to six times
too large. In steps of 0.25 m/s with noise of 0.05 m/s tau came out 0.03 s longer and theta as much shorter, on 8 drives of
10 min: of 14 delays 8 intervals held, and 10 without steps (`python -m benchmarks sensor_effects`). Of the error of rounding
exp(-2 pi² sd²/step²) is left in the mean over noise of that standard deviation (Widrow & Kollar 2008).

A speed is in the headway. In steps of 1 m/s, a third of the movement of the headway, K of range rate came out 1 to 3 % too
large, in steps of 0.5 m/s it held. Where the acceleration is recorded the speed is known without its steps
(mathematics/estimators/complementary_filter.py), and nothing is found.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, NamedTuple

from canid.signals.samples.reading_spans import SPAN_S, ReadingSpan
from canid.signals.signal_checks.blocks import ACCEL, BLOCK_S, GAP, RANGE_RATE, SPEED, Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.types import NAN, Array

# of the standard deviation of the range rate, see above
MAX_STEP_SHARE = 0.5
# 1/s; noise of a fifth of a step makes a 10 Hz radar change its value more often
MAX_CHANGES_HZ = 2.0
# the same for delays alone: noise of a quarter of a step leaves 0.29 of the error, and changes the value of a 10 Hz radar
# 1.13 · 10 / 4 times a second; the error of steps of a fifth of the movement is 6 % of it
MAX_DELAYS_STEP_SHARE, MAX_DELAYS_CHANGES_HZ = 0.2, 2.8
# spans over which the movement is averaged, and needed
MEMORY_SPANS, NEEDED_SPANS = 30, 6


class Moved(NamedTuple):
    """Movement of a signal, of late."""

    seconds: float = 0.0  # behind a lead
    total: float = 0.0  # of the signal, in its unit · s
    squares: float = 0.0  # of it, likewise

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        mean = self.total / self.seconds
        return math.sqrt(max(self.squares / self.seconds - mean * mean, 0.0))


class Steps(NamedTuple):
    """Steps of a signal, of the latest spans that show whether it comes in some."""

    sizes: tuple[float, ...] = ()  # in its unit; 0: on no lattice
    changes: tuple[float, ...] = ()  # 1/s

    def seen(self) -> tuple[float, float]:
        """Smallest step, and changes a second; a step of 0: the signal comes in none, or it is not known."""
        sizes = [size for size in self.sizes if size > 0.0]
        if len(sizes) < NEEDED_SPANS or 2 * len(sizes) < len(self.sizes):
            return 0.0, 0.0
        # of few values only a multiple of the step may be seen
        return min(sizes), sum(self.changes) / len(self.changes)


class State(NamedTuple):
    """Movement of range rate and headway, and the latest steps."""

    rate: Moved = Moved()  # m/s
    headway: Moved = Moved()  # s
    slowness: float = 0.0  # s/m · s, of 1/speed, summed up likewise
    accel: bool = False  # is recorded
    rate_steps: Steps = Steps()  # m/s
    speed_steps: Steps = Steps()  # m/s
    gap_step: float = 0.0  # m, of the last span; 0: on no lattice
    begin: Annotated[float, TIME] = NAN  # s, of the first block behind a lead


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(role: str, state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block.

    Args:
        role: that is judged, "range_rate" or "speed".
        state: from `init()` or the step before.
        block: of a second.
    """
    if block.follows:
        headway = block.values[:, GAP] / block.values[:, SPEED]
        keep = 1.0 - BLOCK_S / (MEMORY_SPANS * SPAN_S)
        state = state._replace(
            rate=_moved(state.rate, block.values[:, RANGE_RATE], keep),
            headway=_moved(state.headway, headway, keep),
            slowness=keep * state.slowness + BLOCK_S / block.mean[SPEED],
            accel=block.mean[ACCEL] == block.mean[ACCEL],
            begin=state.begin if state.begin == state.begin else max(block.t - BLOCK_S, 0.0),
        )
    for span in block.spans:
        if span.role == "gap":
            state = state._replace(gap_step=span.step)
        # of one value no step is known
        if span.kind == "points" and span.changes > 0.0:
            if span.role == "range_rate":
                state = state._replace(rate_steps=_with(state.rate_steps, span))
            if span.role == "speed":
                state = state._replace(speed_steps=_with(state.speed_steps, span))
    if not state.rate.seconds >= NEEDED_SPANS * SPAN_S:
        return state, None
    return state, _rate(state) if role == "range_rate" else _speed(state)


def _moved(before: Moved, values: Array, keep: float) -> Moved:
    return Moved(
        keep * before.seconds + BLOCK_S,
        keep * before.total + float(values.mean()) * BLOCK_S,
        keep * before.squares + float(values @ values) / len(values) * BLOCK_S,
    )


def _with(steps: Steps, span: ReadingSpan) -> Steps:
    sizes = (*steps.sizes, span.step)[-MEMORY_SPANS:]
    return Steps(sizes, (*steps.changes, span.changes)[-MEMORY_SPANS:])


def _rate(state: State) -> Found | None:
    (size, often), moved = state.rate_steps.seen(), state.rate.deviation
    coarse = size > MAX_STEP_SHARE * moved and often < MAX_CHANGES_HZ
    if not (coarse or (size > MAX_DELAYS_STEP_SHARE * moved and often < MAX_DELAYS_CHANGES_HZ)):
        return None
    # a finer gap than what a step of the rate moves in a second is not coarse
    gap = f", gap in steps of {state.gap_step:.2g} m" if state.gap_step >= size else ""
    says = (
        f"range rate comes in steps of {size:.2g} m/s{gap}: it moves by {moved:.2g} m/s, and no noise averages over its "
        f"steps{'' if coarse else '; tau and theta cannot be identified'}"
    )
    remedy = "map a finer signal"
    return Found("range_rate_coarse", ("range_rate",), state.begin, says, remedy, delays_only=not coarse)


def _speed(state: State) -> Found | None:
    (size, often), moved = state.speed_steps.seen(), state.headway.deviation
    # of the headway, at the mean of both
    error = size * state.headway.total / state.headway.seconds * state.slowness / state.headway.seconds
    if state.accel or not (error > MAX_DELAYS_STEP_SHARE * moved and often < MAX_CHANGES_HZ):
        return None
    says = (
        f"speed comes in steps of {size:.2g} m/s: headway moves by {moved:.2g} s, by {error:.2g} s with each step, and no "
        "noise averages over them"
    )
    return Found("speed_coarse", ("speed",), state.begin, says, "map a finer signal, or the acceleration")


CHECKS = (
    Check("coarse_signals", init, partial(step, "range_rate")),
    Check("coarse_speed", init, partial(step, "speed")),
)
