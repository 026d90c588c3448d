"""Samples of a fine grid, pooled to rows of a tenth of a second: the step at which a model of low order is fitted.

A driver's answer ends below 1 Hz. At 50 Hz an ARMAX(2,2,1) describes the noise from one sample to the next and hardly
the driver: its coverage falls with the step. So outputs and inputs are averaged alike, which biases nothing, as FOPDT
does (mathematics/identification/fopdt/regression_rows.py). On a grid of a tenth of a second or more a row is a sample.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from canid.values.state_constraints import NOT_NEGATIVE
from canid.values.types import Sample, Trace

# s; a row is no longer than this: Chen & Ulsoy's 10 Hz
ROW_S = 0.1


class State(NamedTuple):
    """Samples of the present row."""

    row: int = -1
    samples: Annotated[int, NOT_NEGATIVE] = 0
    sums: tuple[float, ...] = ()  # of output and inputs
    learn: bool = True
    segment: int = 0


def per_row(dt: float) -> int:
    """How many samples of a grid of `dt` s are a row.

    >>> [per_row(dt) for dt in (0.01, 0.02, 0.05, 0.1, 0.2)]
    [10, 5, 2, 1, 1]
    """
    return max(math.floor(ROW_S / dt + 1e-6), 1)


def step(state: State, sample: Sample, dt: float, count: int) -> tuple[State, Sample | None]:
    """Take a sample; the row that it completes, with the time, gate and segment of its last sample.

    A row is not learned from unless all its samples are there, may be learned from and are not within reach of a limit.

    Args:
        state: from `State()` or the step before.
        sample: of the grid.
        dt: s, the grid's step.
        count: samples per row, of `per_row`.

    >>> from canid.values.types import LearnGate
    >>> row, state = None, State()
    >>> for k in range(5):
    ...     now = Sample(0.02 * k, 1.0 + k, (2.0 * k,), LearnGate.OPEN, True, 0, {})
    ...     state, row = step(state, now, 0.02, 5)
    >>> row.t, row.output, row.inputs
    (0.08, 3.0, (4.0,))
    """
    # what is next to a limit is left out whatever it is: left out at the limit alone, rows would be selected by the output
    sample = sample._replace(learn=sample.learn and sample.bound != sample.bound)
    if count == 1:
        return state, sample
    k = round(sample.t / dt) if math.isfinite(sample.t) else state.row * count
    row, place = divmod(k, count)
    if row != state.row:
        state = State(row, 0, (0.0,) * (1 + len(sample.inputs)), True, sample.segment)
    values = (sample.output, *sample.inputs)
    state = State(
        row,
        state.samples + 1,
        tuple([a + b for a, b in zip(state.sums, values, strict=True)]),
        state.learn and sample.learn and sample.segment == state.segment,
        state.segment,
    )
    if place != count - 1:
        return state, None
    whole = state.samples == count
    output, *inputs = [x / count if whole else math.nan for x in state.sums]
    return State(row), sample._replace(output=output, inputs=tuple(inputs), learn=state.learn and whole)


def pooled(trace: Trace) -> Trace:
    """Pool the rows of a drive; a grid of a tenth of a second or more stays as it is."""
    count = per_row(trace.dt)
    if trace.bound is not None:
        trace = trace._replace(learn=trace.learn & ~np.isfinite(trace.bound), bound=None)
    if count == 1:
        return trace
    row, place = np.divmod(np.round(trace.t / trace.dt).astype(np.int64), count)
    begin = np.flatnonzero((place == 0)[: len(place) - count + 1])
    whole = begin[(row[begin + count - 1] == row[begin]) & (place[begin + count - 1] == count - 1)]
    every, last = whole[:, None] + np.arange(count), whole + count - 1
    variance = None if trace.variance is None else trace.variance[every].mean(axis=1) / count
    return trace._replace(
        dt=count * trace.dt,
        t=trace.t[last],
        output=trace.output[every].mean(axis=1),
        inputs=trace.inputs[every].mean(axis=1),
        gate=tuple(trace.gate[k] for k in last.tolist()),
        learn=trace.learn[every].all(axis=1) & (trace.segment[whole] == trace.segment[last]),
        segment=trace.segment[last],
        signals={},
        variance=variance,
    )
