"""How often a role's value is updated, and in which steps, from its readings of ten seconds each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.rounding import decimals_step, lattice_step
from canid.signals.samples import rounded_lines
from canid.values.types import NAN, Array

# s; ten readings of a signal of 1 Hz
SPAN_S = 10.0
# readings, values that are held and knots of lines below which a span shows nothing
MIN_READINGS, MIN_HELD, MIN_KNOTS = 8, 4, 5
# readings of the shortest value that is held, and between the knots of a line
MIN_RUN = 2
# times the smallest step: a coarse signal goes from one value to the next, what is held jumps over some; and of the steps
JUMP_FACTOR, JUMP_SHARE = 2.5, 0.6
# changes of a coarse value, and knots, that show a clock; periods that are tried around the usual run; length of the mean
# phase vector: at random phases 12 changes exceed it on 1 of 10,000 spans, 6 knots on 1 of 50, which bend straight lines
MIN_CHANGES, MIN_COHERENT_KNOTS, PERIODS, COHERENT = 12, 6, np.linspace(0.97, 1.03, 13), 0.9
# times the resolution, by which rounding bends a straight line at most
STRAIGHT = 2.05
# Lags: times the resolution, by which a change must be larger to show its share of the one before; shares of lags of half an
# interval to 20; longest over shortest interval
VISIBLE_STEPS, LAG_SHARES, EVEN = 20.0, (0.13, 0.95), 1.05
# of every second reading, that must be straight where it is the middle of a line; and at most of the others
BETWEEN_SHARE, KNOT_SHARE = 0.95, 0.6
# times that, by which knots bend it
BENT = 3.0
# of the times between new values: one that happens to be the old one again makes two of them one
USUAL_QUANTILE = 0.25
# s; sooner no person decides anew (Gawthrop 2011: 0.25 to 0.5 s), so that what is held is held by a program
MIN_DECISION_S = 0.25
# clocks that are tried, relative to the usual interval: of readings every 0.1 s a value of 0.25 s stands for 0.2 or 0.3 s;
# turns over the span by which the next one differs; length of the mean phase vector, of a sender's clock but for the times
# of its readings. Intervals that vary by 12 %, as of a person who keeps a rhythm, leave 0.6 on average
CLOCK_RANGE, CLOCK_TURNS, CLOCKED = (0.7, 1.4), 0.25, 0.95
# of the largest value; what floats make of a straight line
FLOAT_ROUNDING = 1e-6
# s, and of the median interval: nothing is joined or held over a longer one (`Role.stale`, sampling_grid.py), it is a pause
MAX_JOINED_S, PAUSE_FACTOR = 0.5, 3.0
# of the values, that stand for two readings or more where some readings of held ones were lost (half of them, of values
# held for two: 1 of 3); jumps of `JUMP_SHARE` are those of noise of 3 steps and more, whose values repeat by chance 1 in 10
HELD_SHARE = 0.25
# Lines whose knots are not regular, as where readings were lost: of the readings, that are straight (1 of 2 less what is
# lost next to them); times the limit of what is straight, by which the others bend (of Gaussian noise that bends so much 1
# in 9 readings is straight by chance); and how many runs these make, of those of as many in random order (Wald & Wolfowitz
# 1940). Every second or third reading of 10 Hz, where up to 3 in 10 were lost: 1.07 to 1.5; every tenth: 0.8 to 1; lively
# stretches of 0.5 to 4 s between calm ones: up to 0.4
STRAIGHT_SHARE, SURELY_BENT, RANDOM_RUNS = 0.3, 5.0, 0.8


class ReadingSpan(NamedTuple):
    """One role's readings of `SPAN_S` s."""

    role: str
    t: float  # s, of the reading behind them
    update: float  # s, between new values, see `usual_interval`; NaN: the span does not show it
    kind: str  # what stands between new values: "points" nothing, "hold" the last one, "line" a straight line
    step: float  # of the lattice of the values, between two values their difference; 0: none
    changes: float  # 1/s, how often the value changes
    clock: bool = True  # new values come at one phase of a clock, or sooner than a person acts


class Span(NamedTuple):
    """Readings of the span that is being filled."""

    number: int = -1  # which `SPAN_S`
    t: tuple[Array, ...] = ()  # s
    value: tuple[Array, ...] = ()


State = Mapping[str, Span]


def init() -> State:
    """Return the state before the first reading."""
    return {}


def step(
    state: State, role: str, t: Array, value: Array, row: npt.NDArray[np.int64]
) -> tuple[State, list[tuple[int, ReadingSpan]]]:
    """Take some readings of a role.

    Args:
        state: from `init()` or the step before.
        role: of the readings.
        t: (n,) s, ascending.
        value: (n,) in the role's unit; NaN: the reading holds none; infinite: it stands at a limit, and has come all the
            same.
        row: (n,) of the frame that brought each.

    Returns:
        The state, and what every span that is over shows, with the row of the first reading behind it.

    Example:
        >>> t = 0.1 * np.arange(102)
        >>> held = np.random.default_rng(1).standard_normal(30)[(t / 0.5 + 1e-6).astype(int)]
        >>> _, spans = step(init(), "gap", t, held, np.arange(102))
        >>> spans[0][1].kind, round(spans[0][1].update, 2)
        ('hold', 0.5)
    """
    if not len(t):
        return state, []
    span, out = state.get(role, Span()), []
    numbers = np.floor_divide(t, SPAN_S).astype(np.int64)
    starts = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist()]
    for begin, end in zip(starts, [*starts[1:], len(t)], strict=True):
        if numbers[begin] != span.number:
            shown = _shown(role, float(t[begin]), span)
            out += [] if shown is None else [(int(row[begin]), shown)]
            span = Span(int(numbers[begin]))
        span = span._replace(t=(*span.t, t[begin:end]), value=(*span.value, value[begin:end]))
    return {**state, role: span}, out


def _shown(role: str, at: float, span: Span) -> ReadingSpan | None:
    """What a span that is over shows; None: it has too few readings."""
    if not span.t:
        return None
    t, value = np.concatenate(span.t), np.concatenate(span.value)
    came = ~np.isnan(value)
    came[1:] &= t[1:] > np.maximum.accumulate(t)[:-1]
    known = came & np.isfinite(value)
    between = np.diff(t[came])
    t, value = t[known], value[known]
    if len(t) < MIN_READINGS:
        return None
    interval = usual_interval(between)
    resolution = lattice_step(value)
    changed = np.flatnonzero(np.diff(value)) + 1
    changes = len(changed) / float(t[-1] - t[0])
    kind, update, clock = "points", interval if len(changed) else NAN, True
    if (held := _held(t, value, changed)) > 0.0:
        kind, update, clock = "hold", held, _clocked(t[changed], np.diff(t))
    elif (joined := _joined(t, value, resolution)) is not None:
        # too few jumps to be called held: the lines are level
        kind = "line" if np.median(np.abs(np.diff(value))) > 0.0 else "hold"
        update, clock = joined
    elif (lagged := _lagged(t, value, resolution)) is not None:
        kind, (update, clock) = "hold", lagged
    elif (rounded := rounded_lines.period(t, value, max(resolution, decimals_step(value)))) > 0.0:
        kind, update = "line", rounded
    values = np.unique(value)
    step = resolution if len(values) != 2 else float(values[1] - values[0])
    return ReadingSpan(role, at, update, kind, step, changes, clock)


def usual_interval(intervals: Array) -> float:
    """Mean length of the interval that an instant lies in (length-biased; Cox 1962), without pauses, s.

    Samples are more often in the long intervals than in the short ones: where half of the readings of 10 Hz were lost, half
    of the intervals are 0.1 s, and the usual sample is on a line of 0.26 s.

    Args:
        intervals: (n,) s, between new values.

    Example:
        >>> round(usual_interval(np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.5])), 2)
        0.3
    """
    joined = intervals[intervals <= max(MAX_JOINED_S, PAUSE_FACTOR * float(np.median(intervals)))]
    return float(joined @ joined / joined.sum())


def _held(t: Array, value: Array, changed: npt.NDArray[np.int64]) -> float:
    """Seconds for which values are held before they jump; 0: they are not."""
    if len(changed) < MIN_HELD:
        return 0.0
    runs = np.sort(np.diff(changed))
    jumps = np.abs(value[changed] - value[changed - 1])
    jumping = bool(np.mean(jumps > JUMP_FACTOR * jumps.min()) >= JUMP_SHARE)
    # of the shortest runs one may be a reading that was late
    if runs[1] < MIN_RUN:
        lost = jumping and np.mean(runs >= MIN_RUN) >= HELD_SHARE
        return usual_interval(np.diff(t[changed])) if lost else 0.0
    period = float(np.quantile(np.diff(t[changed]), USUAL_QUANTILE))
    if jumping:
        return period
    # coarse values go to the next one, too, but only those that are held do so at one phase of a clock
    return period if _coherent(t[changed], period, MIN_CHANGES) else 0.0


def _coherent(t: Array, period: float, needed: int) -> bool:
    """Whether so many times or more are at one phase of a clock of about this period."""
    turns = np.outer(t, 1.0 / (period * PERIODS))
    return len(t) >= needed and bool(np.abs(np.exp(2j * np.pi * turns).mean(axis=0)).max() > COHERENT)


def _clocked(t: Array, readings: Array) -> bool:
    """Whether new values at times t (n,) s come at one phase of a clock, or sooner than a person acts.

    Read at intervals of r s, they come up to r s late, which leaves sinc(r / period) of the mean phase vector.

    Args:
        t: (n,) s, ascending.
        readings: (m,) s, between readings.
    """
    interval, between = usual_interval(readings), np.sort(np.diff(t))
    shortest = float(np.quantile(between, USUAL_QUANTILE))
    if interval <= EVEN * float(np.median(readings)) and shortest < 1.5 * interval:
        # a movement that lasts for two readings has a value of its own in each: an instant is usually in a longer interval
        shortest = float(between[np.searchsorted(np.cumsum(between), 0.5 * between.sum())])
    if shortest < MIN_DECISION_S:
        return True
    low, high = (
        1.0 / (CLOCK_RANGE[1] * shortest),
        min(1.0 / (CLOCK_RANGE[0] * shortest), 1.0 / MIN_DECISION_S),
    )
    turn = CLOCK_TURNS / float(t[-1] - t[0])
    hz = np.arange(low, high + turn, turn)
    agree = np.abs(np.exp(2j * np.pi * np.outer(hz, t)).mean(axis=1))
    return bool((agree > CLOCKED * np.sinc(interval * hz)).any())


def _lagged(t: Array, value: Array, resolution: float) -> tuple[float, bool] | None:
    """Seconds for which values are held before a lag of first order (a filter of what comes too rarely); None: they are not.

    Each change is then the same share of the one before, but for the one with which a new value comes.
    """
    dt, change = np.diff(t), np.diff(value)
    visible = np.abs(change[:-1]) > VISIBLE_STEPS * max(resolution, decimals_step(value))
    if np.count_nonzero(visible) < MIN_READINGS or float(dt.max()) > EVEN * float(dt.min()):
        return None
    share = float(np.median(change[1:][visible] / change[:-1][visible]))
    if not LAG_SHARES[0] < share < LAG_SHARES[1]:
        return None
    return _between_knots(t, value, change / dt, np.abs(change[1:] - share * change[:-1]), resolution)


def _joined(t: Array, value: Array, resolution: float) -> tuple[float, bool] | None:
    """Seconds between the knots of straight lines, and whether they are on a clock; None: there are none."""
    dt = np.diff(t)
    slope = np.diff(value) / dt
    return _between_knots(t, value, slope, np.abs(np.diff(slope)) * np.minimum(dt[1:], dt[:-1]), resolution)


def _between_knots(
    t: Array, value: Array, slope: Array, bend: Array, resolution: float
) -> tuple[float, bool] | None:
    """Seconds between the readings at which the values bend, and whether on a clock; None: they do not at some alone.

    Args:
        t: (n,) s.
        value: (n,).
        slope: (n - 1,) of the values, in their unit per s.
        bend: (n - 2,) by how much each change differs from what the one before says.
        resolution: of the values.
    """
    dt = np.diff(t)
    limit = max(
        STRAIGHT * max(resolution, decimals_step(value)),
        FLOAT_ROUNDING * float(np.abs(value).max()),
    )
    bent = bend > limit
    even, odd = (float(np.mean(~bent[k::2])) for k in (0, 1))
    if max(even, odd) >= BETWEEN_SHARE and min(even, odd) <= KNOT_SHARE:
        return 2.0 * float(np.median(dt)), True
    first = np.flatnonzero(np.diff(bent.astype(int), prepend=0) == 1)
    length = np.bincount(np.cumsum(np.diff(bent.astype(int), prepend=0) == 1)[bent])[1:]
    # a knot between two readings bends at both
    if len(first) < MIN_KNOTS:
        return None
    if length.max() > MIN_RUN or np.sort(np.diff(first))[1] <= MIN_RUN:
        irregular = (
            # level ones are a value that is held, or coarse
            np.mean(~bent & (slope[1:] != 0.0)) >= STRAIGHT_SHARE
            and np.median(bend[bent]) >= SURELY_BENT * limit
            and len(first) >= RANDOM_RUNS * float(np.mean(bent) * np.sum(~bent))
        )
        return (usual_interval(np.diff(t[first])), _clocked(t[first], dt)) if irregular else None
    period = float(np.quantile(np.diff(t[first]), USUAL_QUANTILE))
    # where rounding hides how straight the lines are, their knots are at one phase of a clock
    if np.median(bend[bent]) >= BENT * limit or _coherent(t[first], period, MIN_COHERENT_KNOTS):
        return period, _clocked(t[first], dt)
    return None
