"""Chunks of frames in; samples, estimates, monitor reports and events out: the composition for live, replay and batch.

`canid.signals.samples.sampler` makes the samples; here every sample goes through the estimators and the monitor.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import itemgetter
from typing import Any, NamedTuple

from canid.mathematics.estimators import ESTIMATORS, agreement, step_watch
from canid.mathematics.estimators.estimator import AnyRunning
from canid.models.monitor import change_monitor
from canid.models.pipeline import restart_time
from canid.signals.samples import sampler
from canid.signals.samples.reading_facts import ReadingFact
from canid.signals.signal_checks import signal_checks
from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.decoding_state import Decoded
from canid.values.types import (
    TASK_INPUTS,
    Array,
    Columns,
    Driver,
    Estimate,
    Event,
    MonitorReport,
    Sample,
    SignalFinding,
    SignalReport,
)

# s; 10 Hz, the rate of Chen & Ulsoy 2001 and well above what a person's answer holds (below 1 Hz)
DT = 0.1
# s; a millisecond is shorter than the time between two frames of any id, a second longer than an answer of a driver
STEPS_S = (1e-3, 1.0)
Output = Sample | Estimate | MonitorReport | SignalReport | Event


class State(NamedTuple):
    """Everything that the next chunk's meaning depends on."""

    sampler: sampler.State
    estimators: tuple[Any, ...]
    time: restart_time.State = restart_time.State()  # of the estimators
    agreement: agreement.State = agreement.State()  # among them
    monitor: change_monitor.State | None = None  # None: not estimating
    signals: signal_checks.State = signal_checks.init()


class Known(NamedTuple):
    """What outlives a restart: what the estimators and the monitor have learnt, and where their time stands."""

    time: restart_time.State
    estimators: tuple[Any, ...]
    agreement: agreement.State
    monitor: change_monitor.State
    signals: signal_checks.State


class Pipeline(NamedTuple):
    """A vehicle's pipeline: pure functions."""

    init: Callable[[], State]
    # a chunk of frames -> outputs in their order, each with the row of the frame that completed or caused it
    step: Callable[[State, Columns], tuple[State, list[tuple[int, Output]]]]
    resume: Callable[[State, Known], State]  # from `init()`, with what was known before a restart
    # the same as `step`, with what the frames held and their times in s
    decoded: Callable[[State, Columns], tuple[State, list[tuple[int, Output]], Decoded, Array]]


class _Parts(NamedTuple):
    """What a pipeline is composed of."""

    sampler: sampler.Sampler
    estimators: tuple[AnyRunning, ...]
    monitor: change_monitor.Monitor | None  # None: not estimating
    driver: Driver
    inputs: int  # of the model
    dt: float  # s


def estimators(vehicle: Vehicle, dt: float = DT) -> tuple[AnyRunning, ...]:
    """Return the estimators, with this vehicle's settings bound."""
    names = TASK_INPUTS[vehicle.driver.task]
    return tuple(
        estimator.make(names, dt, vehicle.estimators.get(estimator.name)) for estimator in ESTIMATORS
    )


def build(vehicle: Vehicle, *, estimating: bool = True, dt: float = DT) -> Pipeline:
    """Compose a vehicle's pipeline.

    Args:
        vehicle: from `read_vehicle`.
        estimating: False leaves the estimators and the monitor out: only samples, reports on the signals and events
            come.
        dt: step of the grid, s, of 0.001 to 1.

    Returns:
        `init() -> state`, `step(state, chunk) -> (state, outputs)` and `resume(state, known) -> state`. However the
        frames are divided into chunks, the outputs are the same to the last bit.

    Raises:
        ValueError: `dt` is none of these steps.
    """
    if not (isinstance(dt, float | int) and STEPS_S[0] <= dt <= STEPS_S[1]):
        raise ValueError(f"dt={dt!r} is no step of the grid in s; give one of 0.001 to 1, such as 0.1")
    names = TASK_INPUTS[vehicle.driver.task]
    parts = _Parts(
        sampler.sampler(vehicle, dt),
        estimators(vehicle, dt) if estimating else (),
        change_monitor.make(names) if estimating else None,
        vehicle.driver,
        len(names),
        dt,
    )
    return Pipeline(
        partial(_init, parts), partial(_step, parts), partial(_resume, parts), partial(_decoded, parts)
    )


def _init(parts: _Parts) -> State:
    states = tuple(estimator.init() for estimator in parts.estimators)
    monitored = None if parts.monitor is None else parts.monitor.init()
    return State(parts.sampler.init(), states, monitor=monitored)


def _step(parts: _Parts, state: State, chunk: Columns) -> tuple[State, list[tuple[int, Output]]]:
    state, out, _, _ = _decoded(parts, state, chunk)
    return state, out


def _decoded(
    parts: _Parts, state: State, chunk: Columns
) -> tuple[State, list[tuple[int, Output]], Decoded, Array]:
    after, made = parts.sampler.step(state.sampler, chunk)
    state = state._replace(sampler=after)
    # of one frame, events come first
    out: list[tuple[int, Output]] = list(made.events)
    stamps = made.stamps
    for row, sample in made.samples:
        while stamps and stamps[0][0] <= row:
            state, stamps = _stamped(state, stamps[0][1]), stamps[1:]
        state, outputs = _estimated(parts, state, sample)
        out += [(row, item) for item in outputs]
    for _, fact in stamps:
        state = _stamped(state, fact)
    out.sort(key=itemgetter(0))
    return state, out, made.decoded, made.t


def _stamped(state: State, fact: ReadingFact) -> State:
    return state._replace(signals=signal_checks.put(state.signals, fact))


def _estimated(parts: _Parts, state: State, sample: Sample) -> tuple[State, list[Output]]:
    """One sample through the estimators and the monitor; returns it and what they put out."""
    time, continued = restart_time.step(state.time, sample, parts.dt)
    states, estimates = [], []
    for estimator, inner in zip(parts.estimators, state.estimators, strict=True):
        inner, estimate = estimator.step(inner, continued)
        states.append(inner)
        if estimate is not None:
            estimates.append(estimate)
    agreed, checked = agreement.step(state.agreement, estimates)
    signals, signal_report = signal_checks.step(state.signals, continued, parts.driver, parts.dt)
    forgotten = {} if signal_report is None else signal_checks.forgotten_at(signal_report.findings)
    if continued.t in forgotten:
        pairs = zip(parts.estimators, states, strict=True)
        states = [estimator.forget(inner, forgotten[continued.t]) for estimator, inner in pairs]
    monitored, monitor_report = state.monitor, None
    if parts.monitor is not None and monitored is not None:
        monitored, monitor_report = parts.monitor.step(monitored, continued)
    after = State(state.sampler, tuple(states), time, agreed, monitored, signals)
    # from here on in session time
    out: list[Output] = [sample]
    if signal_report is not None:
        out.append(restart_time.in_session_time(time, signal_report))
    if checked:
        stand = findings(after)
        shown = [signal_checks.withheld(restart_time.in_session_time(time, e), stand) for e in checked]
        changes = [e.change for e in shown if e.change is not None and e.change.new]
        out += [Event(sample.t, "gain_step", step_watch.says(change)) for change in changes]
        out += shown
    if monitor_report is not None:
        out.append(restart_time.in_session_time(time, monitor_report))
    return after, out


def _resume(parts: _Parts, state: State, known: Known) -> State:
    if parts.monitor is None:
        raise ValueError("resume: this pipeline does not estimate; build it with estimating=True")
    time, pause = restart_time.resume(known.time, parts.dt, parts.inputs)
    pairs = zip(parts.estimators, known.estimators, strict=True)
    paused = tuple(estimator.step(inner, pause)[0] for estimator, inner in pairs)
    monitored, _ = parts.monitor.step(known.monitor, pause)
    signals, _ = signal_checks.step(known.signals, pause, parts.driver, parts.dt)
    return state._replace(
        estimators=paused, time=time, agreement=known.agreement, monitor=monitored, signals=signals
    )


def known(state: State) -> Known | None:
    """Return what outlives a restart; None where no sample has come that could have added to it."""
    if state.monitor is None or state.time.t != state.time.t or state.time.resumed:
        return None
    return Known(state.time, state.estimators, state.agreement, state.monitor, state.signals)


def findings(state: State) -> tuple[SignalFinding, ...]:
    """Return the findings on the signals that stand, in session time."""
    report = SignalReport(state.time.t, signal_checks.findings(state.signals))
    return restart_time.in_session_time(state.time, report).findings
