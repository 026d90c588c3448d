"""Several drives of one driver as one trace, with pauses between them in which nobody follows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.signals.signal_checks.drive_time import of_trace
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.errors import ConfigError
from canid.values.types import NAN, Array, DriveTime, LearnGate, SignalFinding, Trace

# s between two drives: longer than the memory of a driver and of the filters
PAUSE_S = 20.0


class JoinedDrives(NamedTuple):
    """One trace of several drives."""

    trace: Trace
    spans: tuple[tuple[float, float], ...]  # s, [begin, end) of each drive on the trace's clock
    time: DriveTime  # of all drives, without the pauses


def join(traces: Sequence[Trace]) -> JoinedDrives:
    """Put drives one after the other, what the limits of a signal hide left out of each.

    Args:
        traces: of one driver, read with one vehicle file.

    Raises:
        ConfigError: they differ in step, inputs, or output filter.

    Example:
        >>> import canid
        >>> trace = canid.read_trace("replay_logs/following_lost_lead.blf", "generic")
        >>> of = join([trace, trace])
        >>> len(of.spans), of.trace.t.size == 2 * trace.t.size + round(PAUSE_S / trace.dt)
        (2, True)
    """
    traces = [with_limits(trace) for trace in traces]
    first = traces[0]
    if any(
        (trace.dt, trace.input_names, trace.output_filter)
        != (first.dt, first.input_names, first.output_filter)
        for trace in traces
    ):
        raise ConfigError("the drives differ in their inputs: diagnose those of one vehicle file together")
    roles = {role for trace in traces for role in trace.signals}
    pause = _pause(first, roles)
    parts, spans, n = list[Trace](), list[tuple[float, float]](), 0
    for drive in traces:
        if parts:
            parts.append(pause)
            n += pause.t.size
        parts.append(drive)
        spans.append((n * first.dt, (n + drive.t.size) * first.dt))
        n += drive.t.size
    segment, last = list[Array](), 0
    for part in parts:
        segment.append(part.segment - (part.segment[0] if part.segment.size else 0) + last)
        last = int(segment[-1][-1]) + 1 if part.segment.size else last
    findings = [
        _moved(finding, begin - float(drive.t[0]), end)
        for drive, (begin, end) in zip(traces, spans, strict=True)
        for finding in drive.findings
    ]
    trace = first._replace(
        t=np.arange(n, dtype=np.float64) * first.dt,
        output=np.concatenate([part.output for part in parts]),
        inputs=np.concatenate([part.inputs for part in parts]),
        gate=tuple(gate for part in parts for gate in part.gate),
        learn=np.concatenate([part.learn for part in parts]),
        segment=np.concatenate(segment),
        signals={
            role: np.concatenate([part.signals.get(role, np.full(part.t.size, NAN)) for part in parts])
            for role in sorted(roles)
        },
        bound=_columns([part.bound for part in parts], parts),
        variance=None,
        findings=tuple(findings),
    )
    times = [of_trace(drive) for drive in traces]
    return JoinedDrives(
        trace, tuple(spans), DriveTime(*(sum(seconds) for seconds in zip(*times, strict=True)))
    )


def _pause(like: Trace, roles: set[str]) -> Trace:
    n = round(PAUSE_S / like.dt)
    nothing = np.full(n, NAN)
    return like._replace(
        t=np.arange(n, dtype=np.float64) * like.dt,
        output=nothing,
        inputs=np.full((n, like.inputs.shape[1]), NAN),
        gate=(LearnGate.NO_LEAD,) * n,
        learn=np.zeros(n, dtype=bool),
        segment=np.zeros(n, dtype=np.int64),
        signals=dict.fromkeys(roles, nothing),
        bound=None,
        findings=(),
    )


def _columns(columns: Sequence[Array | None], parts: Sequence[Trace]) -> Array | None:
    if all(column is None for column in columns):
        return None
    return np.concatenate(
        [
            np.full(part.t.size, NAN) if column is None else column
            for column, part in zip(columns, parts, strict=True)
        ]
    )


def _moved(finding: SignalFinding, by: float, end: float) -> SignalFinding:
    """A finding on the joined clock; one that stands ends with its drive."""
    until = finding.until + by if finding.until == finding.until else end
    return finding._replace(since=finding.since + by, raised=finding.raised + by, until=until)
