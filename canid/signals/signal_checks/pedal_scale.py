"""A pedal cannot be pressed by more than 100 %: readings above it mean another scale, such as raw counts declared as %.

Readings outside of the range that the vehicle file or the database allows are left out, as codes for "no value" are; a
code is one number, or two. Several different numbers above full travel are positions of the pedal. A scale is that of the
whole drive: the finding holds from the drive's first sample on, however late the pedal is pressed that far.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from canid.signals.signal_checks.blocks import PEDAL, Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.types import NAN

# %; sensors of 8 bits and their calibration go beyond 100 % by a step or two
FULL_TRAVEL_PERCENT = 103.0
# different readings above it: "error" and "not available" are two
MIN_READINGS = 5


class State(NamedTuple):
    """The readings above full travel, up to `MIN_READINGS` different ones, and the highest of all."""

    above: tuple[float, ...] = ()
    highest: float = NAN  # %
    since: Annotated[float, TIME] = NAN  # s, the drive's first sample


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block.

    Example:
        >>> values = np.linspace(110.0, 200.0, 10)[:, None] * np.ones(10)
        >>> step(init(), Block(1.0, 0.1, values, (), (), True, True))[1].says
        'the pedal is pressed by up to 200 %'
    """
    if state.since != state.since:
        state = state._replace(since=block.t - block.dt * (len(block.values) - 1))
    left_out = [reading.value for reading in block.out_of_range if reading.role == "pedal"]
    pedal = np.concatenate([block.values[:, PEDAL], left_out])
    above = np.unique(pedal[pedal > FULL_TRAVEL_PERCENT])
    if above.size:
        kept = (
            {*state.above, *above[:MIN_READINGS].tolist()} if len(state.above) < MIN_READINGS else state.above
        )
        state = State(tuple(sorted(kept)), float(np.nanmax([state.highest, above[-1]])), state.since)
    if len(state.above) < MIN_READINGS:
        return state, None
    says = f"the pedal is pressed by up to {state.highest:.0f} %"
    remedy = (
        f"its scale is wrong: with scale = {100.0 / state.highest:.3g} besides the database's own the highest reading is "
        "100 %; full travel decides"
    )
    return state, Found("pedal_scale", ("pedal",), state.since, says, remedy)


CHECK = Check("pedal_scale", init, step)
