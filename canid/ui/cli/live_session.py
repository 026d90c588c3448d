"""A session on a bus, as `live`, `record` and `demo` run it: shown until it ends, then summarized; and its exit code."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from canid.analysis.session.session import SessionSettings, World, session
from canid.io.buses.bus import ReceiveOnlyBus
from canid.io.recording.controls import Controls
from canid.io.recording.recorder_stats import Stats
from canid.ui.cli.health_lines import ending, health_lines, received, silent
from canid.ui.cli.interrupt import Interrupt
from canid.ui.cli.options import options, publish_options, web_options
from canid.ui.cli.output import background_diagnosis, display, output_kinds, outputs
from canid.ui.cli.output.background_diagnosis import SESSION_PATIENCE_S, BackgroundDiagnosis
from canid.ui.cli.output.observers import Observers
from canid.ui.cli.output.outputs import DetachedOutput, Output, StandardOutput, TextOutput
from canid.ui.cli.priority import raise_priority
from canid.ui.cli.room import check_room
from canid.ui.terminal import streams
from canid.ui.terminal.messages import info, line_printer
from canid.ui.views import end_summary
from canid.ui.views.terminal_view.state import HealthLine, View
from canid.values import bounded_numbers
from canid.values.errors import DONE, NO_BUS, NOT_WRITTEN
from canid.values.text import json_values

if TYPE_CHECKING:
    from canid.ui.web.live_page import LivePage
    from canid.values.findings import Provenance

# s that the end of a session waits for a reader of --json who does not read
JSON_PATIENCE_S = 0.3


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.io.buses.command_line import add_bus_arguments

    parser.add_argument("--duration", type=bounded_numbers.seconds, metavar="S", help="stop after S seconds")
    options.json_file(parser)
    publish_options.arguments(parser)
    web_options.arguments(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace, settings: SessionSettings, page: Output | None = None) -> int:
    """Open the buses and run a session on them; `page`: of the diagnosis of the drive."""
    from canid.io.buses.bus_opener import open_buses
    from canid.io.buses.command_line import configs_of

    estimating = settings.vehicle is not None
    check_room(estimating=estimating)
    with Interrupt() as stop, ExitStack() as stack:  # before the first output: its reader may send a signal
        json = options.json_output(args)
        option = "--record" if estimating else "-o"
        recording = Output(option, str(settings.record), output_kinds.RECORDING) if settings.record else None
        state_file = Output("--state", str(settings.state), output_kinds.STATE) if settings.state else None
        outputs.check([recording, state_file, json, page], options.read_by(args))
        publish_options.check(args)
        if streams.detach():  # a process of its own, not a program that uses canid as a library
            raise_priority()
        controls = Controls()
        diagnosis = stack.enter_context(background_diagnosis.running(page, settings.vehicle, controls))
        # before the buses: it needs half a second to start
        pages = stack.enter_context(web_options.session_page(args, controls, live=estimating))
        buses = open_buses(configs_of(args))
        for bus in buses:
            if not bus.listen_only.warns:  # a warning comes as an event, and stays in the view
                info(bus.listen_only.says)
            if bus.configured_by:
                info(f"{bus.name}: configured by {', '.join(bus.configured_by)}")
        title = " · ".join(["canid live" if estimating else "canid record", *(bus.name for bus in buses)])
        code, _ = watch(
            buses,
            settings,
            View(title, estimating=estimating, events=web_options.announced(pages)),
            json=json,
            stop=stop,
            end_at_once=stop.end_at_once,
            controls=controls,
            diagnosis=diagnosis,
            others=[*pages, *publish_options.publishers(args)],
            pages=pages,
        )
    # a signal may come before the first frame: that nothing was received is said, and not the exit code
    return stop.code if stop() and code in (DONE, NO_BUS) else code


def watch(
    buses: Sequence[ReceiveOnlyBus],
    settings: SessionSettings,
    view: View,
    *,
    stop: Callable[[], bool],
    end_at_once: Callable[[], object] = lambda: None,
    json: Output | None = None,
    controls: Controls | None = None,
    diagnosis: BackgroundDiagnosis | None = None,
    others: Sequence[display.Observer] = (),
    pages: Sequence[LivePage] = (),
) -> tuple[int, end_summary.EstimateTally]:
    """Show a session until it ends; returns the exit code and the estimates.

    `end_at_once` is called once it was shown that a signal now ends the process, whether or not one has come before.

    `others` get what the display gets; they are closed at the end. What one of them raises ends its service alone. Those
    of them that are `pages` are also given the tables of all signals.

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
        sink: TextOutput | None = file or (StandardOutput() if json is not None else None)
        standard = "-" if json is not None and json.stdout else None
        outputs = [display.display(view, json=standard, controls=controls), display.JsonLines(sink)]
        observers = Observers(outputs, others, recording=bool(settings.record))
        running = stack.enter_context(closing(session(buses, settings, stopped=stop, controls=controls)))
        try:
            for item in running:
                lost = (file and file.error) or streams.standard_output_error()
                if lost and not settings.record:
                    raise lost
                if isinstance(item, World):
                    last = item
                    for event in item.events:
                        observers.put(event)
                    warnings = [bus.listen_only.says for bus in buses if bus.listen_only.warns]
                    wrong = [HealthLine(says, wrong=True) for says in warnings]
                    observers.lines([*health_lines(item), *wrong], item.output)
                    if ending(item):
                        end_at_once()
                    observers.status(json_values.plain(recorded(item)))
                    if item.table is not None:
                        for page in pages:
                            page.table(item.table)
                else:
                    tally.put(item.item)
                    observers.put(item.item)
                    if diagnosis is not None:
                        diagnosis.put(item.item)
                for event in diagnosis.events() if diagnosis is not None else ():
                    observers.put(event)
        finally:
            observers.close()
        assert last is not None
        if settings.vehicle is None and sink is not None:
            sink.write(json_values.document("record", recorded(last)) + "\n")
        print_summary(last, tally, standard)
        if diagnosis is not None:
            log = str(last.recorder.path or "")
            diagnosis.finish(partial(_provenance, log, settings), line_printer(standard), SESSION_PATIENCE_S)
        unwritten = file.finish(JSON_PATIENCE_S) if file is not None else ""
        if unwritten:
            info(unwritten)
    if observers.failure or unwritten:
        return NOT_WRITTEN, tally
    return exit_code(last, lost=not stop() and last.lost), tally


def _provenance(log: str, settings: SessionSettings) -> Provenance:
    """Of the diagnosis of a session: its recording, where there is one; of several files the newest."""
    from canid.analysis.drive.drive_reader import as_vehicle
    from canid.ui.cli.provenance import provenance

    assert settings.vehicle is not None
    vehicle = as_vehicle(settings.vehicle)
    command = shlex.join(["canid", "diagnose", log, "--vehicle", vehicle.path]) if log else ""
    return provenance([log] if log else [], vehicle, command)


def print_summary(last: World, tally: end_summary.EstimateTally, json: str | None) -> None:
    """Print the state of the session at its end, and its last estimates."""
    show = line_printer(json)
    show("")
    quiet = silent(last)
    for line in health_lines(last):
        if line.text not in quiet:
            show(line.text)
    for text in end_summary.estimates(tally, last.output):
        show(text)
    for text in [*end_summary.health(None, "", last.counters, ()), *quiet]:
        info(text)


class Recorded(NamedTuple):
    """The object that `canid record --json` writes at the end."""

    recorder: Stats
    path: str  # of the log, or the newest of them
    elapsed: float  # s


def recorded(now: World) -> Recorded:
    """The state of a session in numbers."""
    return Recorded(now.recorder, str(now.recorder.path or ""), now.elapsed)


def exit_code(now: World, *, lost: bool) -> int:
    """The exit code at the end of a session; a bus that was silent all the time is none, while others were not."""
    r = now.recorder
    if r.state.startswith("failed") or r.drops_disk or r.events_unwritten or now.unsaved:
        return NOT_WRITTEN
    return DONE if received(now) and not lost else NO_BUS
