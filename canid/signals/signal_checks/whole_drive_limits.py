"""Limits of output and inputs over a whole drive: closed gates from its first sample on, not from when they were known."""

from __future__ import annotations

import numpy as np

from canid.mathematics.identification.rounding import lattice_step
from canid.signals.samples import learning_gate, limited_lead
from canid.signals.samples.lead import REPORTED
from canid.signals.signal_checks import blocks, saturated_rate
from canid.signals.signal_checks.limited_values import sides
from canid.signals.signal_checks.saturated_rate import NONLINEAR, RATE, SATURATED
from canid.values.findings import Flags
from canid.values.types import NAN, TASK_INPUTS, Array, LearnGate, Sample, SignalFinding, Trace

# gates behind a lead, over which `LearnGate.LIMITED` has precedence where samples are judged one by one
_FOLLOWS = (*learning_gate.SHOWS_DEMAND, LearnGate.BRAKE)
# m; what floats leave of an offset of 0
NO_OFFSET_M = 1e-9


def with_limits(trace: Trace) -> Trace:
    """Leave out what a limit hides, and no more.

    Until a limit of an input was known its readings were taken for measured ones, and a finding covers all that time. Over
    the whole drive they are left out as they are afterwards; the rest of the time is sound, and the finding withholds it
    no more. Behind a filter the readings approach a limit, and few reach it: where the others saturate as well, that
    finding withholds all of the drive.

    Args:
        trace: of a drive, with its findings and its gates as they were judged sample by sample.

    Example:
        >>> from canid.signals.samples.trace_assembly import trace
        >>> from canid.values.types import Driver, Sample
        >>> rates = [0.1, 0.5, 0.5, *[0.2] * 30]
        >>> rows = [
        ...     Sample(0.1 * k, 9.0, (0.0, rate), LearnGate.OPEN, True, 0, {"range_rate_reported": rate})
        ...     for k, rate in enumerate(rates)
        ... ]
        >>> finding = SignalFinding("range_rate_limited_above", ("range_rate",), 0.1, 2.0, "", "", True)
        >>> limited = with_limits(trace(rows, Driver(), 0.1)._replace(findings=(finding,)))
        >>> [gate.name for gate in limited.gate[:4]], int(limited.learn.sum())
        (['OPEN', 'LIMITED', 'LIMITED', 'OPEN'], 11)
    """
    trace, hidden = without_lane(learning_gate.with_limits(trace)), dict[str, Flags]()
    for k, finding in enumerate(trace.findings):
        role, limited = sides(finding)
        if not finding.withholds or REPORTED.get(role) not in trace.signals:
            continue
        at = _at_limit(trace, finding, REPORTED[role], limited)
        if at is None:
            continue
        findings = tuple(
            each._replace(withholds=False) if n == k or _is_limit(each, finding, trace.t, at) else each
            for n, each in enumerate(trace.findings)
        )
        trace = _without(trace, at)._replace(findings=findings)
        hidden[role] = hidden.get(role, at) | at | np.isnan(trace.signals[REPORTED[role]])
    return _smoothed(_without_saturated(trace, hidden), hidden)


def without_lane(trace: Trace) -> Trace:
    """Leave out lateral offsets of 0 that turn into a hole: until it was known that they stand for no lane they counted.

    Args:
        trace: of a drive.

    Example:
        >>> from canid.signals.samples.trace_assembly import trace
        >>> from canid.values.types import Driver, Sample
        >>> rows = [
        ...     Sample(0.1 * k, 1.0, (x,), LearnGate.OPEN, True, 0, {})
        ...     for k, x in enumerate([*[0.2] * 9, 0.0, 0.0, *[NAN] * 5])
        ... ]
        >>> given = trace(rows, Driver("lane_keeping", "steering_angle"), 0.1)
        >>> [int(each.learn.sum()) for each in (given, without_lane(given))]
        [16, 4]
    """
    if trace.input_names != TASK_INPUTS["lane_keeping"] or not len(trace.t):
        return trace
    offset = trace.inputs[:, 0]
    holes = np.isnan(offset)
    at, begins = np.zeros(len(holes), dtype=bool), np.flatnonzero(np.diff(holes.astype(int)) == 1) + 1
    for begin in begins.tolist():
        moves = np.flatnonzero(np.abs(offset[:begin]) > NO_OFFSET_M)
        at[int(moves[-1]) + 1 if moves.size else 0 : begin] = True
    if not at.any():
        return trace
    inputs = np.where(at[:, None], NAN, trace.inputs)
    return trace._replace(inputs=inputs, learn=trace.learn & ~limited_lead.touched(at, trace.dt))


def _smoothed(trace: Trace, hidden: dict[str, Flags]) -> Trace:
    """What the limits hide, as the other signal of the lead shows it."""
    given = {"headway_error", "range_rate"} <= set(trace.input_names) and {
        *REPORTED,
        *REPORTED.values(),
    } <= set(trace.signals)
    return limited_lead.smoothed(trace, hidden) if hidden and given else trace


def _is_limit(other: SignalFinding, finding: SignalFinding, t: Array, at: Flags) -> bool:
    """Whether a value that was called frozen has stood at a limit."""
    role, _ = sides(finding)
    stood = (t > other.since) & (t < other.raised)
    return other.name == f"{role}_frozen" and bool(at[stood].mean() > 0.5 if stood.any() else False)


def _without_saturated(trace: Trace, hidden: dict[str, Flags]) -> Trace:
    """Judge a range rate that saturates by what its limits leave: none of the drive is withheld by it, or all."""
    at = [
        k for k, each in enumerate(trace.findings) if each.withholds and each.name in (SATURATED, NONLINEAR)
    ]
    if not at or RATE not in hidden:
        return trace
    # one that was raised later is of readings that no limit had
    known = max(each.raised for each in trace.findings if sides(each)[0] == RATE)
    saturates = trace.findings[at[-1]].raised >= known or _saturates(trace, ~hidden[RATE])
    findings = list(trace.findings)
    for k in at:
        until = NAN if saturates else findings[k].until
        findings[k] = findings[k]._replace(withholds=saturates, until=until)
    return trace._replace(findings=tuple(findings))


def _saturates(trace: Trace, measured: Flags) -> bool:
    """Whether the range rate saturates where it is measured, (n,)."""
    step = lattice_step(trace.signals[REPORTED[RATE]][measured])
    state, filled = saturated_rate.init()._replace(step=step), blocks.init()
    for k in np.flatnonzero(measured).tolist():
        signals = {role: float(x[k]) for role, x in trace.signals.items() if role in blocks.INDEX}
        sample = Sample(float(trace.t[k]), NAN, (), trace.gate[k], True, 0, signals)
        filled, block = blocks.step(filled, sample, trace.dt)
        if block is not None:
            state, _ = saturated_rate.step(state, block)
    return state.found is not None


def _at_limit(trace: Trace, finding: SignalFinding, name: str, limited: tuple[bool, bool]) -> Flags | None:
    """Samples at the limit that were taken for measured ones, (n,); None: a later one is beyond it."""
    value = trace.signals[name]
    before = trace.t <= finding.raised
    at = np.zeros(len(value), dtype=bool)
    for sign, is_limited in zip((-1.0, 1.0), limited, strict=True):
        if not is_limited:
            continue
        x = sign * value
        limit = np.fmax.reduce(x[before], initial=-np.inf)
        if np.fmax.reduce(x, initial=-np.inf) > limit:
            return None
        # later ones are not measured: they are left out already
        at |= x == limit
    return at


def _without(trace: Trace, at: Flags) -> Trace:
    """Close the gate at the limit; what it touches teaches nothing."""
    touched = limited_lead.touched(at, trace.dt)
    gate = tuple(
        LearnGate.LIMITED if here and each in _FOLLOWS else each
        for here, each in zip(at.tolist(), trace.gate, strict=True)
    )
    bound = None if trace.bound is None else np.where(touched, NAN, trace.bound)
    return trace._replace(gate=gate, learn=trace.learn & ~touched, bound=bound)
