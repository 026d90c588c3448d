"""Samples in blocks of one second: what the checks take, so that a sample costs little and a check sees an average."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from canid.signals.samples.reading_facts import Limited, OutOfRange, ReadingFact, added
from canid.signals.samples.reading_spans import ReadingSpan
from canid.signals.samples.stamps import StampIntervals
from canid.values.state_constraints import TIME
from canid.values.types import NAN, Array, Sample

# s; long against a radar's report, short against a driver's manoeuvre
BLOCK_S = 1.0

# the columns of a block: gap and range rate as they were reported, before the smoothing makes them agree
COLUMNS = (
    "gap_reported",
    "range_rate_reported",
    "speed",
    "accel",
    "gnss_speed",
    "wheel_speed",
    "pedal",
    "lead_valid",
    "brake",
    "cruise_active",
)
INDEX = {name: k for k, name in enumerate(COLUMNS)}
GAP, RANGE_RATE, SPEED, ACCEL, GNSS_SPEED, WHEEL_SPEED, PEDAL, LEAD_VALID, BRAKE, CRUISE = range(10)

# m/s; below walking pace a headway says nothing, wheel sensors lose pulses and radars their Doppler signal
CREEP_SPEED = 2.0
# m of change of the gap from one sample to the next, and m/s: another vehicle is at least a short car's length nearer or
# further (signals/samples/smoothing.py), and no lead departs or approaches faster than that
MAX_GAP_STEP_M, MAX_RANGE_RATE = 2.0, 20.0


# samples in a row with which a signal stands still at its largest or smallest value so far, and s after which that is a
# frozen value: until then it may be a limit that is not known yet, and then it contradicts what it is compared with
END_SAMPLES, MAX_AT_END_S = 3, 20.0


class Block(NamedTuple):
    """One second of samples."""

    t: float  # s, of its last sample
    dt: float  # s
    values: Array  # (n, len(COLUMNS)); NaN = not measured
    mean: tuple[float, ...]  # of each column; NaN where one sample of it is
    spread: tuple[float, ...]  # largest minus smallest value of each column; NaN likewise
    joined: bool  # the block before it ends one sample earlier
    follows: bool  # one lead is measured throughout, within the signals' limits, by a vehicle that moves
    stamps: tuple[StampIntervals, ...] = ()  # that have come with it
    out_of_range: tuple[OutOfRange, ...] = ()
    spans: tuple[ReadingSpan, ...] = ()  # likewise
    limited: tuple[Limited, ...] = ()  # limits that have become known with it
    # as `follows`, but that the range rate stands at its extreme so far: it may be a limit that is not known
    at_end: bool = False


class AtEnd(NamedTuple):
    """Whether a signal stands still at its largest or smallest value so far, where it may be limited."""

    lowest: float = math.inf
    highest: float = -math.inf
    blocks: int = 0  # in a row in which it has

    @property
    def may_be_limited(self) -> bool:
        """Whether it stands there, and not for so long that it is frozen."""
        return 0.0 < self.blocks * BLOCK_S <= MAX_AT_END_S


class State(NamedTuple):
    """Samples of the block that is being filled."""

    t: Annotated[float, TIME] = NAN  # s, of the last sample
    rows: tuple[Mapping[str, float], ...] = ()  # signals by role
    joined: bool = False
    gap: float = NAN  # m, of the last sample of the block before
    stamps: tuple[StampIntervals, ...] = ()
    out_of_range: tuple[OutOfRange, ...] = ()
    spans: tuple[ReadingSpan, ...] = ()
    limited: tuple[Limited, ...] = ()
    rate: AtEnd = AtEnd()  # m/s, the range rate


def init() -> State:
    """Return the state before the first sample."""
    return State()


def put(state: State, came: ReadingFact) -> State:
    """Add what readings show; the next block has it."""
    if isinstance(came, ReadingSpan):
        return state._replace(spans=(*state.spans, came))
    if isinstance(came, Limited):
        return state._replace(limited=(*state.limited, came))
    if isinstance(came, OutOfRange):
        return state._replace(out_of_range=added(state.out_of_range, came))
    return state._replace(stamps=(*state.stamps, came))


def step(state: State, sample: Sample, dt: float) -> tuple[State, Block | None]:
    """Take a sample; return the block that it completes.

    Args:
        state: from `init()` or the step before.
        sample: of the grid.
        dt: the grid's step, s.

    Example:
        >>> from canid.values.types import LearnGate
        >>> state = init()
        >>> for k in range(10):
        ...     sample = Sample(0.1 * k, 0.0, (), LearnGate.OPEN, True, 0, {"speed": 20.0 + k})
        ...     state, block = step(state, sample, 0.1)
        >>> block.mean[SPEED], block.spread[SPEED], block.joined
        (24.5, 9.0, False)
    """
    t = sample.t
    if not t - state.t <= 1.5 * dt:
        state = state._replace(rows=(), joined=False, gap=NAN)
    rows = (*state.rows, sample.signals)
    if len(rows) < round(BLOCK_S / dt):
        return state._replace(t=t, rows=rows), None
    values = _values(rows)
    lowest = np.minimum.reduce(values)
    mean = (np.add.reduce(values) / len(rows)).tolist()
    spread = (np.maximum.reduce(values) - lowest).tolist()
    rate = at_end(state.rate, values[:, RANGE_RATE])
    # comparisons with NaN are false
    measured = (
        mean[LEAD_VALID] == 1.0
        and spread[LEAD_VALID] == 0.0
        and bool(lowest[SPEED] > CREEP_SPEED)
        and mean[RANGE_RATE] == mean[RANGE_RATE]
        and _same_lead(values[:, GAP], state.gap, dt)
    )
    block = Block(
        t,
        dt,
        values,
        tuple(mean),
        tuple(spread),
        state.joined,
        measured and not rate.may_be_limited,
        state.stamps,
        state.out_of_range,
        state.spans,
        state.limited,
        measured and rate.may_be_limited,
    )
    return State(t, (), True, float(values[-1, GAP]), rate=rate), block


def _values(rows: tuple[Mapping[str, float], ...]) -> Array:
    """Lay out the samples of a block as columns."""
    present = [name for name in COLUMNS if name in rows[0]]
    try:
        numbers = np.array([[row[name] for name in present] for row in rows])
    except KeyError:  # the samples differ in what they hold
        return np.array([[row.get(name, NAN) for name in COLUMNS] for row in rows])
    values = np.full((len(rows), len(COLUMNS)), NAN)
    values[:, [INDEX[name] for name in present]] = numbers
    return values


def at_end(before: AtEnd, values: Array) -> AtEnd:
    """Take the (n,) samples of a block.

    Example:
        >>> at_end(AtEnd(-1.0, 1.0), np.array([0.6, 1.2, 1.2, 1.2, 0.4])).may_be_limited
        True
    """
    lowest, highest = (
        float(end)
        for end in (
            np.fmin.reduce(values, initial=before.lowest),
            np.fmax.reduce(values, initial=before.highest),
        )
    )
    # 0 is where a motion rests
    ends = ((values == lowest) | (values == highest)) & (values != 0.0)
    same = (values[1:] == values[:-1]) & ends[1:]
    stands = int(np.count_nonzero(same)) >= END_SAMPLES - 1
    return AtEnd(lowest, highest, before.blocks + 1 if stands else 0)


def _same_lead(gap: Array, before: float, dt: float) -> bool:
    """Whether the gap goes on without a jump; `before` is its last value before the block, m."""
    limit = MAX_GAP_STEP_M + MAX_RANGE_RATE * dt
    steps = np.abs(gap[1:] - gap[:-1]).max()
    return bool(steps < limit) and not abs(float(gap[0]) - before) >= limit
