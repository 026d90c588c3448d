"""A session on a bus: the recorder's threads here, the estimators in a process of their own.

The live loop, which steps the pipeline with what was received, is `canid.analysis.session.estimator_process`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path
from queue import Empty, Queue
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.analysis.session.estimator_process import Counts, Estimating
from canid.io.buses.bus import ReceiveOnlyBus, interfaces
from canid.io.buses.bus_opener import open_buses
from canid.io.files import state_keeper
from canid.io.recording.controls import Controls
from canid.io.recording.recorder import Recorder, Stats
from canid.io.recording.rotation import Rotation
from canid.io.recording.trigger_gate import TriggerGate
from canid.signals.triggers.trigger import Trigger, needs_vehicle
from canid.values.errors import CanidError
from canid.values.types import Estimate, Event

# cantools and pydantic take half a second to import, which `canid.ui.cli.room` does before a file is created
if TYPE_CHECKING:
    from canid.models.pipeline.pipeline import Output
    from canid.signals.vehicle import Vehicle
    from canid.values.signal_table import SignalTable

# s between two reports on recorder and buses
REPORT_INTERVAL_S = 0.25
# s after the end of the recording that the estimators have for what still waits for them; the rest is counted
FINISH_S = 1.0


class World(NamedTuple):
    """How recorder, buses and estimators are."""

    elapsed: float  # s since the start
    recorder: Stats
    estimator: Counts | None  # None: not estimating
    counters: dict[str, int]  # what the decoder could not use
    missing: tuple[str, ...]  # mapped signals that never came
    events: tuple[Event, ...]  # the recorder's own, since the last report
    lost: bool  # every bus is gone
    output: str  # the role that is the driver's output; "" while the estimator starts
    unsaved: str = ""  # why the estimators' state could not be saved; "": it could, or need not be
    stopping: bool = False  # the end was asked for: what was received is being written
    scale: str = ""  # of a pedal whose scale nothing confirms
    table: SignalTable | None = None  # of all signals, where a page shows them and a new one is there


class Result(NamedTuple):
    """One output of the pipeline, and when the frame that completed it was received."""

    frame_t: float  # s, session time
    item: Output


class SessionSettings(NamedTuple):
    """What a session does: records, estimates, or both."""

    vehicle: Vehicle | str | Path | None = None  # vehicle file, its name or its value; None records only
    record: str | Path | None = (
        None  # path of the log; an existing file is never overwritten: see `Stats.path`
    )
    duration: float | None = None  # s; None: until stopped
    # Go on from what was learnt before and saved in this file; save there every 10 s and at the end. A state that is
    # damaged or does not fit is reported as an `Event`, and the estimators start anew.
    state: str | Path | None = None
    rotation: Rotation | None = (
        None  # new files by size or time, and as many as it says are kept; None: one file
    )
    # s that the estimators have, after the recording has ended, for the frames that still wait for them
    finish: float = FINISH_S
    # Record only what is around its triggers; from `signals.triggers.trigger.checked`, with signals that
    # `signals.triggers.resolution.resolve` has found. While its conditions cannot be evaluated, all is recorded.
    trigger: Trigger | None = None
    trigger_vehicle: str | Path | None = None  # whose signals the conditions name, where `vehicle` is None
    tables: bool = False  # tables of all signals may be asked for by `Controls.show_signals`
    command: Sequence[str] | None = None  # of the estimator's process; tests put faulty ones here


def session(
    buses: Sequence[ReceiveOnlyBus],
    settings: SessionSettings,
    *,
    stopped: Callable[[], bool] = lambda: False,
    controls: Controls | None = None,
) -> Generator[Result | World, None, None]:
    """Record and estimate until the duration is over, `stopped()` says so, or every bus is lost.

    Frames are on their way to the disk before anything else is even imported; whatever the estimators do, the
    recording goes on. When it ends, all that was received is written and the file is closed, with a `World` four
    times a second meanwhile. The estimators then have `settings.finish` s for what still waits for them, and the last
    `World` says how many frames they did not get to.

    Args:
        buses: from `open_buses`; they are shut down at the end.
        settings: what is recorded and estimated.
        stopped: asked ten times a second.
        controls: marks, and a request to stop, from a person at the session. A mark stands in the log and the journal,
            and comes as an `Event`.

    Raises:
        ConfigError: the vehicle file is wrong, or the state file cannot be read.
        OutputError: the state file cannot be written; found out before anything begins.
    """
    vehicle, record, trigger = settings.vehicle, settings.record, settings.trigger
    try:
        saved = state_keeper.saved(settings.state)
    except CanidError:
        for bus in buses:
            bus.shutdown()
        raise
    save = state_keeper.saver(settings.state, saved)
    # Not a SimpleQueue: before Python 3.13 its `get(timeout=...)` waits for ever where a signal's handler returns after
    # the timeout, on a busy machine or in a process that stood still, and the signal that should end us has no effect.
    results: Queue[Result] = Queue()
    began = time.monotonic()
    estimating = None
    decoded_by = vehicle if vehicle is not None else settings.trigger_vehicle
    gate = _gate(trigger, decoded_by) if trigger is not None and record is not None else None
    evaluated = trigger if gate is not None and trigger is not None and needs_vehicle(trigger) else None
    if vehicle is not None or (evaluated is not None and decoded_by is not None):
        name = str(
            decoded_by if isinstance(decoded_by, str | Path) or decoded_by is None else decoded_by.path
        )
        estimating = Estimating(
            name,
            lambda t, item: results.put(Result(t, item)),
            settings.command,
            saved,
            evaluated,
            gate.answered if gate is not None and evaluated is not None else None,
            interfaces(buses),
            "canid.analysis.session.estimator_process"
            if vehicle is not None
            else "canid.analysis.session.trigger_process",
            tables=settings.tables and vehicle is not None,
        )
    # the estimator takes seconds to import its mathematics; its frames wait for it
    consumer = estimating.put if estimating else None
    recorder = Recorder(buses, record, consumer, settings.rotation, gate, prompt=vehicle is not None)

    def report(*, lost: bool = False, stopping: bool = False) -> World:
        elapsed, events = time.monotonic() - began, tuple(recorder.events())
        if estimating is None or vehicle is None:
            never = tuple(estimating.missing) if estimating is not None else ()
            return World(elapsed, recorder.stats(), None, {}, never, events, lost, "", stopping=stopping)
        decoded = dict(estimating.counters), tuple(estimating.missing)
        counts, unsaved = estimating.counts(), save(estimating.state)
        output, scale = estimating.output, estimating.scale
        if controls is not None and controls.signals_shown:
            estimating.ask_table()
        seen = elapsed, recorder.stats(), counts, *decoded, events, lost, output, unsaved, stopping, scale
        return World(*seen, estimating.take_table())

    recorder.start()
    for bus in buses:
        if not bus.listen_only.warns:  # a warning is an event of the bus itself
            recorder.journal(Event(0.0, "listen_only", bus.listen_only.says))
        if bus.configured_by:
            recorder.journal(Event(0.0, "configuration", f"{bus.name}: {', '.join(bus.configured_by)}"))
    stopping = threading.Thread(target=recorder.stop, name="canid-stop")
    lost, finish = False, settings.finish
    try:
        if isinstance(vehicle, str | Path):
            from canid.signals.vehicle import read_vehicle

            # reports a mistake in it here, not in the estimators' process; recording has begun meanwhile
            read_vehicle(vehicle)
        reported = began
        while not stopped() and recorder.alive() and not (controls and controls.stop_requested):
            now = time.monotonic()
            for mark in controls.take_marks() if controls else ():
                recorder.mark(mark)
            if settings.duration is not None and now - began >= settings.duration:
                break
            if now - reported >= REPORT_INTERVAL_S:
                reported = now
                yield report()
            try:
                result = results.get(timeout=0.05)
            except Empty:
                continue
            _note(recorder, result)
            yield result
        lost = not recorder.alive()
        for mark in controls.take_marks() if controls else ():
            recorder.mark(mark)  # made just before the end was asked for
        stopping.start()
        while stopping.is_alive():
            stopping.join(REPORT_INTERVAL_S)
            yield report(lost=lost, stopping=True)
        if gate is not None:
            finish = max(finish - gate.waited, 0.0)  # the same process was waited for already
        if estimating is not None:
            closing = threading.Thread(target=estimating.close, args=(finish,), name="canid-finish")
            closing.start()
            while closing.is_alive():
                closing.join(REPORT_INTERVAL_S)
                yield report(lost=lost, stopping=True)
    finally:
        if stopping.ident is None:
            recorder.stop()
        else:
            stopping.join()
        if estimating is not None:
            estimating.close(finish)
            save(estimating.state)
    while not results.empty():
        result = results.get()
        _note(recorder, result)
        yield result
    yield report(lost=lost)


def _gate(trigger: Trigger, vehicle: object) -> TriggerGate:
    """What holds frames back until a trigger."""
    says = f"armed: {' | '.join(trigger.conditions)}; {trigger.pre:g} s before and {trigger.post:g} s after are recorded"
    evaluating = needs_vehicle(trigger) and vehicle is not None
    return TriggerGate(
        trigger.pre, trigger.post, evaluating=evaluating, own_events=trigger.own_events, says=says
    )


def _note(recorder: Recorder, result: Result) -> None:
    """Write events to the journal next to the log."""
    if isinstance(result.item, Event):
        recorder.journal(result.item)


def live(
    channel: str = "",
    interface: str = "",
    *,
    vehicle: Vehicle | str | Path,
    record: str | Path | None = None,
    duration: float | None = None,
    state: str | Path | None = None,
    rotation: Rotation | None = None,
    finish: float = FINISH_S,
    **bus: Any,
) -> Iterator[Estimate]:
    """Estimates from a bus, as they come; nothing is ever sent.

    Args:
        channel: of python-can, such as "can0"; empty: from can.conf or CAN_CHANNEL.
        interface: of python-can, such as "socketcan"; empty: from can.conf or CAN_INTERFACE.
        vehicle: a vehicle file, its name, or what `read_vehicle` returned.
        record: record to this file as well; an existing one is never overwritten.
        duration: s; None: until the bus is lost or the generator is closed.
        state: go on from what was learnt before and saved in this file; save there every 10 s and at the end.
        rotation: record into new files by size or time, and keep as many as it says; None: one file.
        finish: s that the estimators have, at the end, for frames that still wait for them: more for a bus that a log
            is played onto faster than it was recorded.
        bus: python-can's other arguments, such as bitrate.

    Yields:
        an `Estimate` of each estimator every half second.

    Raises:
        BusError: no such bus.
        ConfigError: the vehicle file is wrong, or the state file cannot be read.
        OutputError: the state file cannot be written.
    """
    given = {"channel": channel, "interface": interface}
    config = {name: value for name, value in given.items() if value} | bus
    settings = SessionSettings(vehicle, record, duration, state, rotation, finish)
    for result in session(open_buses([config]), settings):
        if isinstance(result, Result) and isinstance(result.item, Estimate):
            yield result.item
