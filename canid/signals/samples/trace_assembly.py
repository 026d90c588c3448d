"""Samples as the columns of a `Trace`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.values.types import TASK_INPUTS, Array, Driver, Sample, Trace


def trace(samples: Sequence[Sample], driver: Driver, dt: float) -> Trace:
    """Samples as columns; rows that the log skips are NaN."""
    names = TASK_INPUTS[driver.task]
    roles = sorted({role for sample in samples for role in sample.signals})
    return Trace(
        dt=dt,
        t=np.array([s.t for s in samples]),
        output=np.array([s.output for s in samples]),
        inputs=np.array([s.inputs for s in samples]).reshape(len(samples), len(names)),
        input_names=names,
        gate=tuple(s.gate for s in samples),
        learn=np.array([s.learn for s in samples], dtype=bool),
        segment=np.array([s.segment for s in samples], dtype=np.int64),
        signals={role: np.array([s.signals.get(role, np.nan) for s in samples]) for role in roles},
        output_filter=driver.output_filter,
        latency=driver.latency,
        full_scale=driver.full_scale,
        bound=np.array([s.bound for s in samples]),
        variance=_variance(samples, 1 + len(names)),
    )


def part(trace: Trace, rows: slice) -> Trace:
    """Rows of a trace; the findings keep their times."""
    return trace._replace(
        t=trace.t[rows],
        output=trace.output[rows],
        inputs=trace.inputs[rows],
        gate=trace.gate[rows],
        learn=trace.learn[rows],
        segment=trace.segment[rows],
        signals={role: column[rows] for role, column in trace.signals.items()},
        bound=None if trace.bound is None else trace.bound[rows],
        variance=None if trace.variance is None else trace.variance[rows],
    )


def _variance(samples: Sequence[Sample], width: int) -> Array | None:
    if not any(s.variance for s in samples):
        return None
    return np.array([s.variance or (np.nan,) * width for s in samples])


def joined(parts: Sequence[Trace]) -> Trace:
    """Put traces together that follow each other; what a part does not know, a role or the variances, is NaN there.

    Example:
        >>> import numpy as np
        >>> from canid.values.types import Driver, LearnGate
        >>> later = Sample(0.1, 1.0, (2.0, 3.0), LearnGate.OPEN, True, 1, {"gap": 20.0}, variance=(0.1, 0.2, 0.3))
        >>> before = later._replace(t=0.0, signals={}, variance=())
        >>> whole = joined([trace([sample], Driver(), 0.1) for sample in (before, later)])
        >>> whole.signals["gap"], whole.variance[:, 0]
        (array([nan, 20.]), array([nan, 0.1]))
    """
    filled = [part for part in parts if part.t.size] or parts[:1]
    first = filled[0]
    return first._replace(
        t=np.concatenate([part.t for part in filled]),
        output=np.concatenate([part.output for part in filled]),
        inputs=np.concatenate([part.inputs for part in filled]),
        gate=tuple(gate for part in filled for gate in part.gate),
        learn=np.concatenate([part.learn for part in filled]),
        segment=np.concatenate([part.segment for part in filled]),
        signals={
            role: np.concatenate([part.signals.get(role, np.full(part.t.size, np.nan)) for part in filled])
            for role in sorted({role for part in filled for role in part.signals})
        },
        bound=np.concatenate([part.bound for part in filled if part.bound is not None]),
        variance=_joined_variance(filled),
    )


def _joined_variance(parts: Sequence[Trace]) -> Array | None:
    if all(part.variance is None for part in parts):
        return None
    width = 1 + len(parts[0].input_names)
    known = [
        np.full((part.t.size, width), np.nan) if part.variance is None else part.variance for part in parts
    ]
    return np.concatenate(known)
