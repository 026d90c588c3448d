"""Range rates in steps that are large against their own movement, with no noise that would average over the steps.

What is rounded stands still and jumps, later than it moves. In steps of 0.5 m/s, with 0.8 m/s of movement, tau came out
0.1 to 0.2 s too long on 10 of 12 drives of 8 min, and with a gap in steps of 1 m as well K of headway error up to six times
too large. In steps of 0.25 m/s with noise of 0.05 m/s tau came out 0.03 s longer and theta as much shorter, on 8 drives of
10 min: of 14 delays 8 intervals held, and 10 without steps (`python -m benchmarks sensor_effects`). Of the error of rounding
exp(-2 pi² sd²/step²) is left in the mean over noise of that standard deviation (Widrow & Kollar 2008).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from canid.signals.samples.reading_spans import SPAN_S
from canid.signals.signal_checks.blocks import BLOCK_S, RANGE_RATE, Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.types import NAN

# of the standard deviation of the range rate, see above
MAX_STEP_SHARE = 0.5
# 1/s; noise of a fifth of a step makes a 10 Hz radar change its value more often
MAX_CHANGES_HZ = 2.0
# the same for delays alone: noise of a quarter of a step leaves 0.29 of the error, and changes the value of a 10 Hz radar
# 1.13 · 10 / 4 times a second; the error of steps of a fifth of the movement is 6 % of it
MAX_DELAYS_STEP_SHARE, MAX_DELAYS_CHANGES_HZ = 0.2, 2.8
# spans over which the movement is averaged, and needed
MEMORY_SPANS, NEEDED_SPANS = 30, 6


class State(NamedTuple):
    """Movement of the range rate, and the latest steps of both."""

    seconds: float = 0.0  # behind a lead, of late
    total: float = 0.0  # m/s · s, of the range rate
    squares: float = 0.0  # (m/s)² · s
    steps: tuple[float, ...] = ()  # m/s, of each span that shows a lattice
    changes: tuple[float, ...] = ()  # 1/s, with them
    gap_step: float = 0.0  # m, of the last span; 0: on no lattice
    begin: Annotated[float, TIME] = NAN  # s, of the first block behind a lead
    found: Found | None = None


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    if block.follows:
        keep = 1.0 - BLOCK_S / (MEMORY_SPANS * SPAN_S)
        rate = block.values[:, RANGE_RATE]
        state = state._replace(
            seconds=keep * state.seconds + BLOCK_S,
            total=keep * state.total + block.mean[RANGE_RATE],
            squares=keep * state.squares + float(rate @ rate) / len(rate),
            begin=state.begin if state.begin == state.begin else max(block.t - BLOCK_S, 0.0),
        )
    for span in block.spans:
        if span.role == "gap":
            state = state._replace(gap_step=span.step)
        # of one value no step is known
        if span.role == "range_rate" and span.kind == "points" and span.changes > 0.0:
            steps = (*state.steps, span.step)[-MEMORY_SPANS:]
            changes = (*state.changes, span.changes)[-MEMORY_SPANS:]
            state = state._replace(steps=steps, changes=changes)
            state = state._replace(found=_judged(state))
    return state, state.found


def _judged(state: State) -> Found | None:
    steps = [size for size in state.steps if size > 0.0]
    if len(steps) < NEEDED_SPANS or 2 * len(steps) < len(state.steps):
        return None
    if not state.seconds >= NEEDED_SPANS * SPAN_S:
        return None
    mean = state.total / state.seconds
    moved = math.sqrt(max(state.squares / state.seconds - mean * mean, 0.0))
    # of few values only a multiple of the step may be seen
    size, often = min(steps), sum(state.changes) / len(state.changes)
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


CHECK = Check("coarse_signals", init, step)
