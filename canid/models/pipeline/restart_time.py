"""The estimators' own time: it stands still while canid does not run, so that a restart is a short break in a drive.

A new session counts time and segments from 0 again. Rather than shift every time inside every estimator's state,
whatever its fields are, the samples are brought to the time at which the estimators stood.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from canid.values.types import NAN, Estimate, Interval, LearnGate, MonitorReport, Sample, SignalReport

Output = TypeVar("Output", Estimate, MonitorReport, SignalReport)


class State(NamedTuple):
    """How the estimators' time and segments differ from the session's."""

    t: float = NAN  # s, session time of the last sample
    segment: int = 0  # of the last sample, as the session counts
    ahead: float = 0.0  # s, the estimators' time minus the session's
    segments: int = 0  # the estimators' segment number minus the session's
    resumed: bool = False  # no sample has come since


def step(state: State, sample: Sample, dt: float) -> tuple[State, Sample]:
    """Bring a sample to the estimators' time. Without a restart it is the same sample.

    Args:
        state: from `State()`, `resume` or the step before.
        sample: in session time.
        dt: the grid's step, s.

    Example:
        >>> old = State(t=90.0, segment=2)
        >>> state, pause = resume(old, 0.1, 1)
        >>> state, moved = step(state, Sample(0.3, 20.0, (0.1,), LearnGate.OPEN, True, 0, {}), 0.1)
        >>> round(pause.t, 9), round(moved.t, 9), moved.segment
        (90.1, 90.2, 3)
    """
    if state.resumed:
        # nanoseconds, as all times: a sum of offsets must not grow digits with every restart
        ahead = round(state.t + dt - sample.t, 9)
        state = State(state.t, state.segment, ahead, state.segment - sample.segment)
    moved = state._replace(t=sample.t, segment=sample.segment)
    if not state.ahead and not state.segments:
        return moved, sample
    return moved, sample._replace(t=sample.t + state.ahead, segment=sample.segment + state.segments)


def in_session_time(state: State, item: Output) -> Output:
    """Bring an output back to the session's time, the inverse of `step`. Without a restart it is the same output.

    Args:
        state: from the step of the sample that the output belongs to.
        item: with all its times in the estimators' time.

    Example:
        >>> report = MonitorReport(90.0, False, 80.0, "driver", "", {})
        >>> in_session_time(State(t=30.0, ahead=60.0), report)[:3]
        (30.0, False, 20.0)
    """
    if not state.ahead:
        return item
    by = -state.ahead
    if isinstance(item, Estimate):
        change = item.change
        moved = None if change is None else change._replace(t=Interval(*(t + by for t in change.t)))
        return item._replace(t=state.t, change=moved)
    if isinstance(item, MonitorReport):
        blocks = {name: block._replace(since=block.since + by) for name, block in item.blocks.items()}
        return item._replace(t=state.t, since=item.since + by, blocks=blocks)
    findings = tuple(
        finding._replace(since=finding.since + by, raised=finding.raised + by, until=finding.until + by)
        for finding in item.findings
    )
    return item._replace(t=state.t, findings=findings)


def resume(state: State, dt: float, inputs: int) -> tuple[State, Sample]:
    """Go on after a restart.

    Args:
        state: as it was saved, after at least one sample.
        dt: the grid's step, s.
        inputs: how many the model has.

    Returns:
        the state, and the one sample that stands for the downtime however long it was: nothing measured, and the
        inputs' history breaks. After it an estimator speaks at once, as after any closed gate.
    """
    t, segment = state.t + state.ahead + dt, state.segment + state.segments + 1
    pause = Sample(t, NAN, (NAN,) * inputs, LearnGate.STALE, False, segment, {})
    return State(t, segment, resumed=True), pause
