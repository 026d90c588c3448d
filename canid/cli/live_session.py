"""A session on a bus, as `live`, `record` and `demo` run it: shown until it ends, then summarized; and its exit code."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from typing import Any

from canid.buses.bus import ReceiveOnlyBus
from canid.cli import options, publish_options, web_options
from canid.cli.interrupt import Interrupt
from canid.cli.output import display, output_kinds, outputs, streams
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import DetachedOutput, Output, StandardOutput, TextOutput
from canid.cli.priority import raise_priority
from canid.controls import Controls
from canid.errors import DONE, NO_BUS, NOT_WRITTEN
from canid.recording.rotation import Rotation
from canid.session import Result, World, session
from canid.triggers.trigger import Trigger
from canid.types import Estimate, MonitorReport, SignalReport
from canid.views import end_summary, json_values, status_lines
from canid.views.terminal_view.state import HealthLine, View

# s after which a mapped signal that has not come is reported: slow messages come once a second
MISSING_AFTER_S = 5.0
# s that the end of a session waits for a reader of --json who does not read
JSON_PATIENCE_S = 0.3


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.buses.command_line import add_bus_arguments

    parser.add_argument("--duration", type=options.seconds, metavar="S", help="stop after S seconds")
    options.json_file(parser)
    publish_options.arguments(parser)
    web_options.arguments(parser)
    add_bus_arguments(parser)


def run(
    args: argparse.Namespace,
    *,
    vehicle: str | None,
    record: str | None,
    state: str | None = None,
    rotation: Rotation | None = None,
    trigger: Trigger | None = None,
) -> int:
    """Open the buses and run a session on them."""
    from canid.buses.bus_opener import open_buses
    from canid.buses.command_line import configs_of

    with Interrupt() as stop, ExitStack() as stack:  # before the first output: its reader may send a signal
        json = options.json_output(args)
        option = "--record" if vehicle else "-o"
        recording = Output(option, record, output_kinds.RECORDING) if record else None
        state_file = Output("--state", state, output_kinds.STATE) if state else None
        outputs.check([recording, state_file, json], options.read_by(args))
        publish_options.check(args)
        if streams.detach():  # a process of its own, not a program that uses canid as a library
            raise_priority()
        controls = Controls()
        # before the buses: it needs half a second to start
        page = stack.enter_context(web_options.session_page(args, vehicle, controls))
        buses = open_buses(configs_of(args))
        for bus in buses:
            if not bus.listen_only.warns:  # a warning comes as an event, and stays in the view
                info(bus.listen_only.says)
            if bus.configured_by:
                info(f"{bus.name}: configured by {', '.join(bus.configured_by)}")
        title = " · ".join(["canid live" if vehicle else "canid record", *(bus.name for bus in buses)])
        code, _ = watch(
            buses,
            vehicle,
            View(title, estimating=vehicle is not None, events=web_options.announced(page)),
            controls=controls,
            record=record,
            state=state,
            duration=args.duration,
            json=json,
            stop=stop,
            rotation=rotation,
            trigger=trigger,
            trigger_vehicle=args.vehicle if trigger is not None else None,
            observers=[*page, *publish_options.publishers(args)],
        )
    return stop.code if stop() and code == DONE else code


def watch(
    buses: Sequence[ReceiveOnlyBus],
    vehicle: str | None,
    view: View,
    *,
    record: str | None,
    duration: float | None,
    json: Output | None,
    stop: Callable[[], bool],
    state: str | None = None,
    rotation: Rotation | None = None,
    controls: Controls | None = None,
    observers: Sequence[display.Observer] = (),
    trigger: Trigger | None = None,
    trigger_vehicle: str | None = None,
) -> tuple[int, end_summary.EstimateTally]:
    """Show a session until it ends; returns the exit code and the estimates.

    `observers` get what the display gets; they are closed at the end. What one of them raises ends its service alone.

    The session never waits for an output (`streams.detach`, `DetachedOutput`). An output that cannot be written ends a
    session that does not record, never one that does.
    """
    streams.detach()
    tally = end_summary.EstimateTally()
    last: World | None = None
    with ExitStack() as stack:
        for bus in buses:
            stack.callback(bus.shutdown)
        file = DetachedOutput(json) if json is not None and not json.stdout else None
        if file is not None:
            stack.callback(file.finish, JSON_PATIENCE_S)  # after an error
        shown = SessionOutput(
            buses, view, json, file, recording=bool(record), controls=controls, observers=observers
        )
        running = stack.enter_context(
            closing(
                session(
                    buses,
                    vehicle,
                    record=record,
                    duration=duration,
                    stopped=stop,
                    state=state,
                    rotation=rotation,
                    controls=controls,
                    trigger=trigger,
                    trigger_vehicle=trigger_vehicle,
                )
            )
        )
        try:
            for item in running:
                if isinstance(item, World):
                    last = item
                elif isinstance(item.item, Estimate):
                    tally.put(item.item)
                elif isinstance(item.item, SignalReport):
                    tally.distrust(item.item)
                shown.put(item)
        finally:
            shown.close()
        assert last is not None
        if vehicle is None:
            shown.write_json(to_json(last))
        print_summary(last, tally, "-" if json is not None and json.stdout else None)
        unwritten = file.finish(JSON_PATIENCE_S) if file is not None else ""
        if unwritten:
            info(unwritten)
    if shown.failure or unwritten:
        return NOT_WRITTEN, tally
    return exit_code(last, lost=not stop() and last.lost), tally


class SessionOutput:
    """Display and JSON lines of a running session. Where one of them fails, a recording goes on without them."""

    def __init__(
        self,
        buses: Sequence[ReceiveOnlyBus],
        view: View,
        json: Output | None,
        file: DetachedOutput | None,
        *,
        recording: bool,
        controls: Controls | None = None,
        observers: Sequence[display.Observer] = (),
    ) -> None:
        """Open the display; `file` takes the JSON lines, or standard output where `json` is that."""
        self.failure = ""  # why nothing is shown any more
        self._buses = buses
        self._file = file
        self._sink: TextOutput | None = file or (StandardOutput() if json is not None else None)
        self._recording = recording
        standard = "-" if json is not None and json.stdout else None
        self._display = display.display(view, json=standard, controls=controls)
        self._observers = list(observers)

    def put(self, item: Result | World) -> None:
        """Show one item of the session. Raises what an output raises, unless the session records."""
        lost = (self._file and self._file.error) or streams.standard_output_error()
        if lost and not self._recording:
            raise lost
        for observer in [*self._observers]:
            try:
                self._observe(observer, item)
            except Exception as error:  # of any kind: the session goes on without it
                self._observers.remove(observer)
                info(
                    f"{type(observer).__name__} has failed ({type(error).__name__}: {error}); the session goes on"
                )
                self._end(observer)
        if self.failure:
            return
        try:
            self._show(item)
        except Exception as error:  # such as a number that cannot be shown
            if not self._recording:
                raise
            self.failure = f"{type(error).__name__}: {error}"
            self._end(self._display)  # the terminal is restored, and shows this line
            info(f"output cannot be written ({self.failure}); the recording goes on")

    def _observe(self, observer: display.Observer, item: Result | World) -> None:
        if isinstance(item, World):
            for event in item.events:
                observer.put(event)
            warnings = [
                HealthLine(bus.listen_only.says, wrong=True) for bus in self._buses if bus.listen_only.warns
            ]
            observer.lines([*health_lines(item), *warnings], item.output)
            observer.status(to_json(item))
        else:
            observer.put(item.item)

    def _end(self, observer: display.Observer) -> None:
        try:
            observer.close()
        except Exception as error:
            info(f"{type(observer).__name__} cannot be closed ({error})")

    def _show(self, item: Result | World) -> None:
        self._observe(self._display, item)
        if isinstance(item, World):
            return
        if isinstance(item.item, Estimate | MonitorReport | SignalReport):
            display.write_json(self._sink, item.item)

    def write_json(self, value: dict[str, Any]) -> None:
        """Write one line of JSON."""
        if self._sink is not None:
            self._sink.write(json_values.document("record", value) + "\n")

    def close(self) -> None:
        """Close the display and the observers."""
        for observer in self._observers:
            self._end(observer)
        if not self.failure:
            self._display.close()


def print_summary(last: World, tally: end_summary.EstimateTally, json: str | None) -> None:
    """Print the state of the session at its end, and its last estimates."""
    show = line_printer(json)
    show("")
    for line in health_lines(last):
        show(line.text)
    for text in end_summary.estimates(tally, last.output):
        show(text)
    for text in end_summary.health(None, "", last.counters, ()):
        info(text)


def to_json(now: World) -> dict[str, Any]:
    """The JSON object that `canid record --json` writes at the end."""
    r = now.recorder
    buses = [b._asdict() | {"load": json_values.number(b.load)} for b in r.buses]
    counts = {
        key: getattr(r, key)
        for key in (
            "state",
            "frames",
            "written",
            "bytes",
            "errors",
            "files",
            "drops_disk",
            "events_unwritten",
            "start_ns",
            "rate",
            "lag",
        )
    }
    trigger = r.trigger._asdict() if r.trigger is not None else None
    more = {"elapsed": now.elapsed, "drops": r.drops_bus, "buses": buses, "trigger": trigger}
    return counts | {"path": str(r.path or "")} | more


def health_lines(now: World) -> list[HealthLine]:
    """Recorder, buses and estimators, a line each; then what is missing."""
    r = now.recorder
    out = [
        status_lines.recorder(
            "stopping" if now.stopping else r.state,
            str(r.path or ""),
            r.frames,
            r.written,
            r.bytes,
            r.lag,
            r.drops_disk,
            r.files,
            r.events_unwritten,
        )
    ]
    if r.trigger is not None and not now.stopping and not r.state.startswith("failed"):
        out.append(status_lines.trigger(*r.trigger))
    total = sum(b.frames for b in r.buses) or 1
    out += [
        status_lines.bus(
            b.name,
            b.state,
            b.frames,
            r.rate * b.frames / total,
            b.load,
            b.drops,
            b.errors,
            b.controller,
            None if b.tec is None or b.rec is None else (b.tec, b.rec),
            b.impossible,
        )
        for b in r.buses
    ]
    behind = 0
    if now.estimator is not None:
        e = now.estimator
        behind = max(e.offered - e.done - e.dropped, 0)
        out.append(status_lines.estimator(e.ready, e.offered, e.done, e.dropped, e.restarts))
    if now.stopping:
        waits_for = status_lines.stopping(r.waiting, behind)
        out += [waits_for] if waits_for is not None else []
    if now.unsaved:
        out.append(HealthLine(now.unsaved, wrong=True))
    if now.elapsed > MISSING_AFTER_S:
        if not r.frames:
            out.append(
                HealthLine(
                    "no frames received: check bit rate, termination, and that another node is on", wrong=True
                )
            )
        else:
            out += [HealthLine(sentence, wrong=True) for sentence in now.missing]
    return out


def exit_code(now: World, *, lost: bool) -> int:
    """The exit code at the end of a session."""
    if now.recorder.state.startswith("failed") or now.unsaved or now.recorder.events_unwritten:
        return NOT_WRITTEN
    return NO_BUS if lost else DONE
