"""`canid replay LOG`: the live view of a recorded log; with --onto, the log sent to a virtual bus."""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Sequence
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.io.recording.controls import Controls
from canid.ui.cli.command_line import reproducing
from canid.ui.cli.inputs import drive_source, reading
from canid.ui.cli.options import options, publish_options, report_option, web_options
from canid.ui.cli.output import background_diagnosis, complete_files, display, output_kinds, outputs
from canid.ui.cli.output.background_diagnosis import BackgroundDiagnosis
from canid.ui.cli.output.observers import Observers
from canid.ui.cli.output.outputs import Output, TextOutput
from canid.ui.cli.provenance import provenance
from canid.ui.terminal.messages import info, line_printer
from canid.ui.views.terminal_view.state import HealthLine, View
from canid.values import bounded_numbers
from canid.values.bus_names import bus_text, of_open_buses
from canid.values.errors import DAMAGED, DONE, ConfigError
from canid.values.text import json_values
from canid.values.types import Estimate, Event, MonitorReport, Sample, SignalReport

if TYPE_CHECKING:
    from canid.analysis.drive.drive_reader import Health
    from canid.analysis.playback.log_tables import LogTables
    from canid.analysis.playback.playback import Duration, Position
    from canid.io.logs import Log
    from canid.signals.vehicle import Vehicle
    from canid.ui.views.drive_report.replay_record import ReplayRecord
    from canid.ui.web.live_page import LivePage


# options that say nothing with --onto
_NOT_ONTO = {"state": "estimates", "web": "shows", "report": "estimates", "diagnose": "diagnoses"}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.io.buses.command_line import add_bus_arguments

    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.time_zone(parser)
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    parser.add_argument(
        "--speed",
        type=bounded_numbers.speed,
        metavar="1|10|max",
        help="factor of real time, or max; default: max, with --onto or --web: 1",
    )
    options.part(parser)
    options.state(parser)
    report_option.add(parser, "write what the live view said over the drive as an HTML page with plots")
    background_diagnosis.arguments(parser)
    options.json_file(parser)
    web_options.arguments(parser)
    publish_options.arguments(parser)
    parser.add_argument(
        "--onto",
        action="store_true",
        help="send the log to the virtual bus of -i and -c instead; "
        "of several -c each takes the bus of its number (vcan1: 1)",
    )
    parser.add_argument(
        "--arm", metavar="CHANNEL", help="with --onto: permit sending to this physical channel"
    )
    add_bus_arguments(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    return {"replay": Estimate | json_values.MonitorLine | SignalReport, "onto": Sent}


def run(args: argparse.Namespace) -> int:
    """Replay."""
    if args.onto:
        for name, does in _NOT_ONTO.items():
            if getattr(args, name) is not None:
                raise ConfigError(f"replay: --onto sends a log and {does} nothing; leave out --{name}")
        if args.publish:
            raise ConfigError("replay: --onto sends frames and estimates nothing; leave out --publish")
        return onto(args)
    if args.vehicle is None and not drive_source.is_table(args.log):
        raise ConfigError("replay needs --vehicle V.toml (`canid init FILE.dbc` proposes one)")
    from canid.analysis.playback import log_tables, playback
    from canid.signals.signal_checks import signal_checks
    from canid.ui.views import end_summary, signal_text

    json = options.json_output(args)
    state = Output("--state", args.state, output_kinds.STATE) if args.state else None
    report = report_option.output(args, "replay")
    diagnosed = background_diagnosis.output(args, "replay", args.log)
    outputs.check([json, state, report, diagnosed], options.read_by(args))
    publish_options.check(args)
    log, vehicle = drive_source.opened(args.log, drive_source.car(args, "replay"))
    record = _record() if report is not None else None
    controls = Controls(args.speed or (1.0 if args.web is not None else math.inf))
    with (
        complete_files.opened(json, growing=True) as sink,  # a line as soon as it is known
        web_options.replay_page(args, log.path.name, vehicle, controls) as pages,
        background_diagnosis.running(diagnosed, vehicle, controls) as diagnosis,
    ):
        title = f"canid replay · {log.path.name} · {vehicle.name}"
        view = View(title, output=vehicle.driver.output, events=web_options.announced(pages))
        publishers = publish_options.publishers(args, log.start_ns or 0)
        terminal = display.display(view, json=args.json, controls=controls)
        observers = Observers([terminal], [*pages, *publishers])
        results = Results(sink, record)
        timed = bool(pages) or isinstance(terminal, display.LiveDisplay)
        duration = playback.Duration(log.path, args.stop) if timed else None
        of_log = not drive_source.is_table(args.log)
        tables = log_tables.LogTables(log.path, vehicle.path) if pages and of_log else None
        health = play(args, log, vehicle, controls, observers, results, duration, diagnosis, tables, pages)
        show = line_printer(args.json)
        show("")
        show(f"{args.log}: {health.duration:.1f} s, {health.frames:,} frames, vehicle {vehicle.name}")
        for line in end_summary.estimates(results.tally, vehicle.driver.output):
            show(line)
        for line in signal_text.findings(signal_checks.episodes(results.reports)):
            show(line)
        command = reproducing(args, "diagnose", args.log)
        diagnosis.finish(partial(provenance, [args.log], vehicle, command), show)
    if report is not None and record is not None:
        _write_page(args, report, record, vehicle, health)
    return reading.report_health(health)


def _record() -> ReplayRecord:
    from canid.ui.views.drive_report.replay_record import ReplayRecord

    return ReplayRecord()


def _write_page(
    args: argparse.Namespace, report: Output, record: ReplayRecord, vehicle: Vehicle, health: Health
) -> None:
    """Write the page of --report."""
    from canid.models.pipeline.pipeline import DT
    from canid.ui.views.drive_report import replay_page

    source = reading.source(args.log, vehicle, reproducing(args, "replay", args.log), health)
    driver = vehicle.driver
    shown = replay_page.ReplayedLog(record, driver.output, driver.task, DT, health.duration, source)
    complete_files.write(report, lambda: replay_page.page(shown))
    info(f"{report.path} written")


class Results:
    """What a replay keeps of its outputs: each comes here once, however often its part of the log is passed."""

    def __init__(self, sink: TextOutput | None, record: ReplayRecord | None) -> None:
        """`sink`: of --json; `record`: of the page of --report."""
        from canid.ui.views.end_summary import EstimateTally

        self.tally = EstimateTally()
        self.reports: list[SignalReport] = []
        self.events: list[Event] = []
        takers = (record, self.tally, display.JsonLines(sink))
        self._takers = [taker for taker in takers if taker is not None]

    def put(self, item: display.Item) -> None:
        """Keep one output."""
        for taker in self._takers:
            taker.put(item)
        if isinstance(item, Event):
            self.events.append(item)
        if isinstance(item, SignalReport):
            self.reports.append(item)


def play(
    args: argparse.Namespace,
    log: Log,
    vehicle: Vehicle,
    controls: Controls,
    observers: Observers,
    results: Results,
    duration: Duration | None,
    diagnosis: BackgroundDiagnosis,
    tables: LogTables | None,
    pages: Sequence[LivePage],
) -> Health:
    """Run the log through the pipeline as `controls` say, and show and keep what comes out; closes the observers.

    With --web, whose page has controls, it stays after the end of the log until it is stopped.

    Raises:
        LogError, ConfigError: no frame was read, or none of them is mapped.
    """
    from canid.analysis.drive import drive_reader
    from canid.analysis.playback import playback
    from canid.signals.signal_checks.output_scale import before_a_drive

    state, frames, last = None, 0, 0.0
    open_scale = [
        HealthLine(says, wrong=True) for says in [before_a_drive(vehicle.driver.full_scale)] if says
    ]
    interactive = args.web is not None
    steps = playback.play(
        log,
        vehicle,
        controls,
        within=options.window(args),
        keep=args.state,
        interactive=interactive,
        stays=interactive,
    )
    ended = False
    try:
        for item in steps:
            for event in diagnosis.events():
                observers.put(event)
            if isinstance(item, playback.Position):
                ended = item.ended
                observers.status(status(item, frames, duration.seconds if duration else None))
                if tables is not None:
                    shown_t = options.window(args).stop if item.ended else item.t
                    show_table(tables, shown_t, controls, pages)
                continue
            if item.frames > frames:  # further than any earlier pass
                state, frames, last = item.state, item.frames, item.t
            for output in item.fresh:
                results.put(output)
                diagnosis.put(output)
            # after the files: what is seen has been written
            for output in item.out:
                observers.put(output)
            if item.out and isinstance(item.out[-1], Sample | Estimate | MonitorReport):
                shown = [HealthLine(f"{item.frames:,} frames"), *open_scale]
                observers.lines(shown, vehicle.driver.output)
    except KeyboardInterrupt:
        if not ended:  # after the end it is how the page is closed
            raise
    finally:
        observers.close()
        if duration is not None:
            duration.close()
        if tables is not None:
            tables.close()
        steps.close()  # an interrupted replay saves its state as well
    # while --json is open: so that no empty file is left
    if not frames:
        raise drive_reader.nothing_read(args.log, options.window(args), log.damage)
    health = drive_reader.health(log, vehicle, state, frames, last, results.events)
    if not health.mapped:
        raise drive_reader.nothing_mapped(args.log, vehicle, health)
    return health


def show_table(tables: LogTables, t: float, controls: Controls, pages: Sequence[LivePage]) -> None:
    """Give the pages a table of all signals where one is ready; ask for that of `t` where a page shows them."""
    if controls.signals_shown:
        tables.at(t)
    table = tables.take()
    if table is not None:
        for page in pages:
            page.table(table)


def status(position: Position, frames: int, duration: float | None) -> dict[str, Any]:
    """What the observers are given of a replay's position; `speed` is infinite at full speed."""
    return {
        "t": position.t,
        "duration": duration,
        "paused": position.playback.paused,
        "speed": position.playback.speed,
        "ended": position.ended,
        "passes": position.passes,
        "seeking": position.seeking,
        "says": position.says,
        "frames": frames,
    }


class Sent(NamedTuple):
    """The object of --onto."""

    log: str
    sent: int  # frames
    not_sent: int = 0  # error frames, and frames of a bus for which no channel was named


def onto(args: argparse.Namespace) -> int:
    """Send the log to a virtual bus."""
    from canid.analysis.drive.drive_reader import nothing_read
    from canid.io.buses.send import onto as send
    from canid.io.logs import open_log

    json = options.json_output(args)
    outputs.check([json], options.read_by(args))
    log = open_log(args.log)
    taken = itertools.count()
    # counted as they are taken: a frame that is not sent is said
    frames = (frame for frame, _ in zip(options.window(args).frames(log), taken, strict=False))
    first = next(frames, None)
    if first is None:
        raise nothing_read(args.log, options.window(args), log.damage)
    with complete_files.opened(json) as sink:
        sent = send(args, chain((first,), frames), speed=args.speed or 1.0, arm=args.arm)
        not_sent = next(taken) - sent
        if sink is not None:
            sink.write(json_values.document("onto", Sent(args.log, sent, not_sent)) + "\n")
    info(f"{sent:,} frames of {args.log} sent")
    if not_sent:
        channels = list(map(str, getattr(args, "channel", ())))
        buses = (
            bus_text(dict(zip(channels, of_open_buses(channels), strict=True))) if len(channels) > 1 else ""
        )
        info(
            f"{not_sent:,} not sent: error frames, or of a bus for which no channel was named"
            + f" ({buses})" * bool(buses)
        )
    return DAMAGED if log.damage else DONE
