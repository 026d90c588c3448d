"""Evidence that the driver's output is held: it repeats itself to the last bit for far longer than ever before.

A likelihood ratio of two two-state chains, CUSUM (Page 1954): how often a repetition was followed by another one, as
learnt, against always. Nothing but a chain is assumed of how people rest a foot.
"""

from __future__ import annotations

from math import log
from typing import NamedTuple

from canid.screening.evidence import BEYOND
from canid.types import NAN

# rows; as long as the predictors' own memory
MEMORY = 1500.0
# How often a repetition is followed by another one before anything was learnt, and as how many rows (30 s) that
# counts: a foot that has never rested may. Some 25 s are a hold then, and no few repetitions are a habit
RESTS = 0.85
_BELIEVED = 150.0
# what a held output does per row: a last bit flickers
_FLICKERS = 1e-3
# output units; below the resolution of any sensor
_SAME = 1e-9


class State(NamedTuple):
    """What was learnt of repetitions, and the evidence."""

    last: float = NAN  # the output one row before
    repeats: bool = False  # it was a repetition already
    after: float = 0.0  # repetitions that had a successor, forgetting
    again: float = 0.0  # of those, the ones that were followed by another
    level: float = 0.0  # log of the CUSUM
    since: float = NAN  # s


def step(state: State, t: float, output: float, threshold: float) -> State:
    """Take one row's output; NaN: nobody's.

    Example:
        >>> state = State()
        >>> for k in range(400):
        ...     state = step(state, 0.2 * k, float(k % 7) if k < 200 else 12.0, 14.0)
        >>> state.level > 14, round(state.since)
        (True, 40)
    """
    if output != output:
        # nobody looks: an output that is the very same afterwards was held meanwhile
        return state
    same = abs(output - state.last) < _SAME
    if not state.repeats:
        return state._replace(last=output, repeats=same)
    often = (state.again + _BELIEVED * RESTS) / (state.after + _BELIEVED)
    usual = min(max(often, RESTS), 1.0 - 2.0 * _FLICKERS)
    gained = log((1.0 - _FLICKERS) / usual) if same else log(_FLICKERS / (1.0 - usual))
    fresh = state.level <= 0.0
    level = min((0.0 if fresh else state.level) + gained, threshold + BEYOND)
    after, again = state.after, state.again
    if level < 0.5 * threshold:
        # what looks like a hold is not learnt as a habit
        kept = 1.0 - 1.0 / MEMORY
        after, again = kept * after + 1.0, kept * again + same
    return State(output, same, after, again, level, t if fresh else state.since)
