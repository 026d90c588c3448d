"""Stuck output detection: the driver's output repeats to the last bit for far longer than is usual.

CUSUM (Page 1954) of the likelihood ratio of two two-state Markov chains: how often a repetition was followed by another
one, as learnt, against always. Nothing but a chain is assumed of how drivers rest the pedal.
"""

from __future__ import annotations

from math import log
from typing import NamedTuple

from canid.models.monitor.evalue_cusum import MAX_EXCESS
from canid.values.types import NAN

# rows; as long as the memory of the predictors
MEMORY_ROWS = 1500.0
# Prior probability that a repetition is followed by another one, and its weight in rows (30 s): a pedal that has never
# rested may. Some 25 s are a stuck output then, and a few repetitions are no habit
PRIOR_REPEAT_PROBABILITY = 0.85
PRIOR_ROWS = 150.0
# probability per row that a stuck output changes: the last bit flickers
FLICKER_PROBABILITY = 1e-3
# output units; below the resolution of any sensor
SAME_OUTPUT = 1e-9


class State(NamedTuple):
    """The learnt frequency of repetitions, and the evidence."""

    last: float = NAN  # the output one row before
    repeats: bool = False  # it was a repetition itself
    repetitions: float = 0.0  # that had a successor, with forgetting
    repeated: float = 0.0  # of those, the ones that were followed by another
    level: float = 0.0  # log of the CUSUM
    since: float = NAN  # s


def step(state: State, t: float, output: float, threshold: float) -> State:
    """Add one row's output; NaN: not to be learnt from.

    Example:
        >>> state = State()
        >>> for k in range(400):
        ...     state = step(state, 0.2 * k, float(k % 7) if k < 200 else 12.0, 14.0)
        >>> state.level > 14, round(state.since)
        (True, 40)
    """
    if output != output:
        # not observed: an output that is exactly the same afterwards was stuck meanwhile
        return state
    same = abs(output - state.last) < SAME_OUTPUT
    if not state.repeats:
        return state._replace(last=output, repeats=same)
    probability = (state.repeated + PRIOR_ROWS * PRIOR_REPEAT_PROBABILITY) / (state.repetitions + PRIOR_ROWS)
    usual = min(max(probability, PRIOR_REPEAT_PROBABILITY), 1.0 - 2.0 * FLICKER_PROBABILITY)
    gained = log((1.0 - FLICKER_PROBABILITY) / usual) if same else log(FLICKER_PROBABILITY / (1.0 - usual))
    restart = state.level <= 0.0
    level = min((0.0 if restart else state.level) + gained, threshold + MAX_EXCESS)
    repetitions, repeated = state.repetitions, state.repeated
    if level < 0.5 * threshold:
        # a probable stuck output is not learnt as a habit
        forgetting = 1.0 - 1.0 / MEMORY_ROWS
        repetitions, repeated = forgetting * repetitions + 1.0, forgetting * repeated + same
    return State(output, same, repetitions, repeated, level, t if restart else state.since)
