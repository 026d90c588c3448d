"""Upper and lower limit of an output: a value that many samples share, none passes, and that is kept longer than others.

A limited output has a point mass at its limit (Tobin 1958), any other density falls towards its end. The samples at the
extreme value are counted against those at the values next to it, in stays as long as those of this output are elsewhere:
a person who holds the pedal still, or a slow sender, repeats every value, and then a repeat is no evidence. An output that
is turned back next to its limit as often as it comes there is seen at its limit all the same: by the movements alone that
come there, without the sample by which one of them is known to.
Sample by sample, so that it is the same live and of a whole drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, NamedTuple

from canid.values.state_constraints import NOT_NEGATIVE
from canid.values.types import NAN

# the extreme value and three next to it: what a density of the sensor's steps would have there
LEVELS = 4
# share of the range so far; values nearer than this differ by the rounding of an interpolation, not by a step of 16 bits
SAME_SHARE = 1e-6
# share of the range so far that the output must have left the extreme by before it comes back: a sensor that flickers
# between two steps comes back at once
AWAY_SHARE = 0.1
# times that a limit must have been reached: a single one may be a rest
MIN_VISITS = 3
# Times what the fullest value next to it has. A motion that turns smoothly at one height every time is in its last sensor
# step 2.4 times as long as in the one next to it: 1 / (√2 − 1).
MIN_RATIO = 3.0
# twice the log likelihood ratio of two Poisson counts of stays; none of 1,800 random outputs without a limit has it, moving,
# held at intervals or periodic, at steps of 0 to a quarter of their standard deviation
NEEDED_EVIDENCE = 30.0


# standard deviations of the change from one sample to the next, which one in 700 exceeds on one side
MARGIN_SD = 3.0


class Level(NamedTuple):
    """One of the extreme values."""

    value: float
    samples: Annotated[int, NOT_NEGATIVE] = 1
    visits: Annotated[int, NOT_NEGATIVE] = 1
    turned: Annotated[int, NOT_NEGATIVE] = (
        0  # of the samples, those of movements that did not reach the outermost
    )
    coming: Annotated[int, NOT_NEGATIVE] = (
        0  # of the samples, those since the output was away from the outermost
    )

    @property
    def passed(self) -> int:
        """Samples on ways to the outermost and back."""
        return self.samples - self.turned - self.coming


class State(NamedTuple):
    """What the samples so far have shown."""

    samples: Annotated[int, NOT_NEGATIVE] = 0
    stays: Annotated[int, NOT_NEGATIVE] = 0  # runs of one value
    last: float = NAN
    change: Annotated[float, NOT_NEGATIVE] = 0.0  # sum of the squared changes from sample to sample
    # extreme values, each from the outermost on, and whether the output has been away from the outermost since
    top: tuple[Level, ...] = ()
    bottom: tuple[Level, ...] = ()  # of the output times -1
    top_left: bool = False
    bottom_left: bool = False


class Limits(NamedTuple):
    """Where an output ends; infinite: nowhere that its samples show."""

    lower: float = -math.inf
    upper: float = math.inf
    tolerance: float = 0.0  # a value no further from a limit than this is at it
    margin: float = 0.0  # a sample after one that is further from a limit than this hardly ever is at it

    def side(self, output: float) -> int:
        """-1 at the lower limit, 1 at the upper one, else 0.

        Example:
            >>> [Limits(0.0, 100.0).side(x) for x in (0.0, 50.0, 100.0)]
            [-1, 0, 1]
        """
        return int(output >= self.upper - self.tolerance) - int(output <= self.lower + self.tolerance)


NOWHERE = Limits()


def init() -> State:
    """Return the state before the first sample."""
    return State()


def step(state: State, output: float) -> State:
    """Count a sample, finite, of which nothing else hides the driver's demand."""
    if not state.samples:
        return State(1, 1, output, 0.0, (Level(output),), (Level(-output),))
    # of a sample beyond all before it as well: its own distance from them is the range's
    span = max(output, state.top[0].value) + max(-output, state.bottom[0].value)
    same = SAME_SHARE * span
    top, top_left = _counted(state.top, state.top_left, output, span, same)
    bottom, bottom_left = _counted(state.bottom, state.bottom_left, -output, span, same)
    stays = state.stays + (abs(output - state.last) > same)
    change = state.change + (output - state.last) ** 2
    return State(state.samples + 1, stays, output, change, top, bottom, top_left, bottom_left)


def _counted(
    levels: tuple[Level, ...], left: bool, value: float, span: float, same: float
) -> tuple[tuple[Level, ...], bool]:
    """Count a value among the outermost ones."""
    if len(levels) == LEVELS and value < levels[-1].value - same:
        if levels[0].value - value < AWAY_SHARE * span:
            return levels, left
        return tuple(_turned(level) if level.coming else level for level in levels), True
    for k, level in enumerate(levels):
        if abs(value - level.value) <= same:
            back = k == 0 and left
            more = level._replace(
                samples=level.samples + 1,
                visits=level.visits + back,
                coming=level.coming + (left and not back),
            )
            levels = (*levels[:k], more, *levels[k + 1 :])
            return (_reached(levels) if back else levels), left and not back
    at = sum(level.value > value for level in levels)
    if at == 0:
        return (Level(value), *_reached(levels))[:LEVELS], False
    away = left or levels[0].value - value >= AWAY_SHARE * span
    return (*levels[:at], Level(value, coming=int(away)), *levels[at:])[:LEVELS], away


def _turned(level: Level) -> Level:
    return level._replace(turned=level.turned + level.coming, coming=0)


def _reached(levels: tuple[Level, ...]) -> tuple[Level, ...]:
    return tuple(level._replace(coming=0) if level.coming else level for level in levels)


def limits(state: State) -> Limits:
    """Return the limits that the samples so far show, and the margin whether they show any or not.

    Example:
        >>> import numpy as np
        >>> pedal = 60 + 40 * np.sin(0.1 * np.arange(600)) + np.random.default_rng(1).normal(size=600)
        >>> find(np.clip(pedal, 30.0, 80.0).tolist())[:2], find(pedal.tolist())[:2]
        ((30.0, 80.0), (-inf, inf))
    """
    if not state.samples:
        return NOWHERE
    upper, lower = _is_limit(state, state.top), _is_limit(state, state.bottom)
    # at the limits it does not change
    moving = state.samples - upper * state.top[0].samples - lower * state.bottom[0].samples
    margin = MARGIN_SD * (state.change / max(moving, 1)) ** 0.5
    span = state.top[0].value + state.bottom[0].value
    return Limits(
        -state.bottom[0].value if lower else -math.inf,
        state.top[0].value if upper else math.inf,
        SAME_SHARE * span,
        margin,
    )


def _is_limit(state: State, levels: tuple[Level, ...]) -> bool:
    outermost, *others = levels
    if outermost.visits < MIN_VISITS or not others:
        return False
    # samples of a stay elsewhere: without those at either end, which may both be limits
    ends = (state.top[0], state.bottom[0])
    elsewhere = state.samples - sum(end.samples for end in ends)
    length = max(elsewhere / max(state.stays - sum(end.visits for end in ends), 1), 1.0)
    return _kept_longer(
        outermost.samples / length, max(level.samples for level in others) / length
    ) or _kept_longer(
        (outermost.samples - outermost.visits) / length, max(level.passed for level in others) / length
    )


def _kept_longer(stays: float, others: float) -> bool:
    """Are there more stays than three times the others, by more than chance?"""
    expected = max(others, 1.0)
    if stays <= MIN_RATIO * expected:
        return False
    return 2.0 * (stays * math.log(stays / expected) - (stays - expected)) >= NEEDED_EVIDENCE


def find(output: Iterable[float]) -> Limits:
    """Find the limits that a whole drive shows: of its samples, finite, of which nothing else hides the demand."""
    state = init()
    for y in output:
        state = step(state, y)
    return limits(state)
