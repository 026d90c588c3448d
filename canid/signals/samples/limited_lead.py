"""The lead's motion over a whole drive, smoothed once more without the readings at a limit, which the other signal bridges.

What a driver does after a limit is the answer to what was there as well, to the memory of the lag. A limited range rate in
its place is always too small, which makes a lag too long; the gap shows its integral, and of a limited gap the range rate
shows how it changes.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from canid.signals.samples import smoothing
from canid.signals.samples.lead import REPORTED
from canid.signals.samples.learning_gate import CREEP_SPEED, DEFAULT_RECOVERY_S
from canid.signals.samples.report_noise import Noise
from canid.signals.samples.sampling_grid import MAX_PAUSE_S
from canid.signals.samples.smoothing import Age
from canid.values.findings import Flags
from canid.values.types import NAN, Array, Trace

# s; through a stay at a limit the filter goes on with the signal that is not limited, however long
THROUGHOUT = Age(np.inf, np.inf)


def touched(at: Flags, dt: float) -> Flags:
    """What is not learned from, (n,): a limit, what has been smoothed with it before, and what mainly follows from it.

    Args:
        at: (n,) where a signal is at a limit.
        dt: s.

    Example:
        >>> np.flatnonzero(touched(np.arange(60) == 20, 0.1))[[0, -1]].tolist()
        [15, 39]
    """
    ahead, behind = (round(seconds / dt) for seconds in (smoothing.LAG_S, DEFAULT_RECOVERY_S))
    near: Flags = np.convolve(at, np.ones(ahead + behind), "full")[ahead:][: len(at)] > 0.5
    return near


def smoothed(trace: Trace, hidden: Mapping[str, Flags]) -> Trace:
    """Return the drive with its lead smoothed once more in what is touched by a limit.

    A gap that the drive does not know stays unknown: its target may be another one. What is learned from is as it was.

    Args:
        trace: of a drive behind a lead, with its reports.
        hidden: gap or range rate -> (n,), where it is at a limit.

    Example:
        >>> from canid.signals.samples.trace_assembly import trace
        >>> from canid.values.types import Driver, LearnGate, Sample
        >>> rows, rate, gap = [], 0.5 * np.sin(0.3 * np.arange(200)), 30.0 - np.cos(0.3 * np.arange(200)) / 6
        >>> for k in range(200):
        ...     reports = {"gap_reported": gap[k], "range_rate_reported": min(rate[k], 0.4), "gap": gap[k], "speed": 20.0}
        ...     reports["range_rate"] = reports["range_rate_reported"]
        ...     below = bool(rate[k] < 0.4)
        ...     rows.append(Sample(0.1 * k, 9.0, (0.0, reports["range_rate"]), LearnGate.OPEN, below, 0, reports))
        >>> drive = trace(rows, Driver(), 0.1)
        >>> known = smoothed(drive, {"range_rate": drive.signals["range_rate_reported"] == 0.4})
        >>> [round(float(np.abs(each.inputs[30:150, 1] - rate[30:150]).max()), 1) for each in (drive, known)]
        [0.1, 0.0]
    """
    signals = trace.signals
    reports = {
        role: np.where(hidden[role], NAN, signals[name]) if role in hidden else signals[name]
        for role, name in REPORTED.items()
    }
    speed = signals.get("speed", np.full(len(trace.t), NAN))
    gap, rate = _smoothed(trace, reports["gap"], reports["range_rate"], speed)
    near = touched(np.logical_or.reduce(list(hidden.values())), trace.dt) & ~trace.learn
    gap = np.where(near & np.isfinite(gap), gap, signals["gap"])
    rate = np.where(near & np.isfinite(rate), rate, signals["range_rate"])
    inputs, names = trace.inputs.copy(), trace.input_names
    moved = np.where(near, gap - signals["gap"], 0.0) / np.maximum(speed, CREEP_SPEED)
    inputs[:, names.index("headway_error")] += moved
    inputs[:, names.index("range_rate")] = np.where(near, rate, inputs[:, names.index("range_rate")])
    return trace._replace(inputs=inputs, signals={**signals, "gap": gap, "range_rate": rate})


def _smoothed(trace: Trace, gap: Array, rate: Array, speed: Array) -> tuple[Array, Array]:
    """Gap and range rate (n,) of reports (n,), NaN where none was; a pause and another vehicle begin anew."""
    out = np.full((2, len(trace.t)), NAN)
    state, points, before = smoothing.State(), list[smoothing.Smoothed](), (NAN, -1)
    columns = (column.tolist() for column in (trace.t, gap, rate, speed, trace.segment))
    for t, g, r, v, segment in zip(*columns, strict=True):
        if segment != before[1] or t - before[0] > MAX_PAUSE_S:
            points += smoothing.flush(state, THROUGHOUT)
            state = smoothing.fresh(state)
        before = t, segment
        state, more, _ = smoothing.step(state, t, g, r, Noise(), THROUGHOUT, v)
        points += more
    points += smoothing.flush(state, THROUGHOUT)
    if points:
        t, *values = np.array([point[:3] for point in points]).T
        out[:, np.searchsorted(trace.t, t)] = values
    return out[0], out[1]
