"""`canid replay LOG`: the live view of a recorded log; with --onto, the log sent to a virtual bus."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from canid.cli import drive_source, options, publish_options, reading, report_option, web_options
from canid.cli.output import display, output_kinds, outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import Output, TextOutput
from canid.controls import Controls
from canid.errors import DAMAGED, DONE, ConfigError
from canid.types import Estimate, Event, MonitorReport, Sample, SignalReport
from canid.views.terminal_view.state import HealthLine, View

if TYPE_CHECKING:
    from canid.drive_reader import Health
    from canid.logs import Log
    from canid.playback import Position
    from canid.vehicle import Vehicle
    from canid.views.drive_report.replay_record import ReplayRecord
    from canid.views.end_summary import EstimateTally


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.buses.command_line import add_bus_arguments

    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    parser.add_argument(
        "--speed",
        type=options.speed,
        metavar="1|10|max",
        help="factor of real time, or max; default: max, with --onto or --web: 1",
    )
    options.part(parser)
    options.state(parser)
    report_option.add(parser, "write what the live view said over the drive as an HTML page with plots")
    options.json_file(parser)
    web_options.arguments(parser)
    publish_options.arguments(parser)
    parser.add_argument(
        "--onto", action="store_true", help="send the log to the virtual bus of -i and -c instead"
    )
    parser.add_argument(
        "--arm", metavar="CHANNEL", help="with --onto: permit sending to this physical channel"
    )
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Replay."""
    if args.onto:
        if args.state is not None:
            raise ConfigError("replay: --onto sends a log and estimates nothing; leave out --state")
        if args.web is not None:
            raise ConfigError("replay: --onto sends a log and shows nothing; leave out --web")
        if args.report is not None:
            raise ConfigError("replay: --onto sends a log and estimates nothing; leave out --report")
        if args.publish:
            raise ConfigError("replay: --onto sends frames and estimates nothing; leave out --publish")
        return onto(args)
    if args.vehicle is None and not drive_source.is_table(args.log):
        raise ConfigError("replay needs --vehicle V.toml (`canid init FILE.dbc` proposes one)")
    from canid.signal_checks import signal_checks
    from canid.views import end_summary, signal_text

    json = options.json_output(args)
    state = Output("--state", args.state, output_kinds.STATE) if args.state else None
    report = report_option.output(args, "replay")
    outputs.check([json, state, report], options.read_by(args))
    publish_options.check(args)
    log, vehicle = drive_source.opened(args.log, drive_source.car(args, "replay"))
    tally = end_summary.EstimateTally()
    reports: list[SignalReport] = []
    record = _record() if report is not None else None
    controls = Controls(args.speed or (1.0 if args.web is not None else math.inf))
    with (
        outputs.opened(json) as sink,
        web_options.replay_page(args, log.path.name, vehicle, controls) as observers,
    ):
        publishers = publish_options.publishers(args, log.start_ns or 0)
        health = play(args, log, vehicle, tally, reports, sink, controls, observers, publishers, record)
    show = line_printer(args.json)
    show("")
    show(f"{args.log}: {health.duration:.1f} s, {health.frames:,} frames, vehicle {vehicle.name}")
    for line in end_summary.estimates(tally, vehicle.driver.output):
        show(line)
    for line in signal_text.findings(signal_checks.episodes(reports)):
        show(line)
    if report is not None and record is not None:
        _write_page(args, report, record, vehicle, health)
    return reading.report_health(health)


def _record() -> ReplayRecord:
    from canid.views.drive_report.replay_record import ReplayRecord

    return ReplayRecord()


def _write_page(
    args: argparse.Namespace, report: Output, record: ReplayRecord, vehicle: Vehicle, health: Health
) -> None:
    """Write the page of --report."""
    from canid.cli.provenance import provenance
    from canid.pipeline import DT
    from canid.views import end_summary
    from canid.views.drive_report import replay_page

    shown = replay_page.ReplayedLog(
        record,
        vehicle.driver.output,
        vehicle.driver.task,
        DT,
        health.duration,
        end_summary.health(health.damage, health.back_in_time, health.counters, health.missing),
        provenance([args.log], vehicle, report_option.command(args, "replay", args.log)),
        vehicle.name,
        damaged=bool(health.damage or health.back_in_time),
    )
    with outputs.opened(report) as file:
        if file is not None:
            file.write(replay_page.page(shown))
    info(f"{report.path} written")


def play(
    args: argparse.Namespace,
    log: Log,
    vehicle: Vehicle,
    tally: EstimateTally,
    reports: list[SignalReport],
    sink: TextOutput | None,
    controls: Controls,
    observers: Sequence[display.Observer] = (),
    publishers: Sequence[display.Observer] = (),
    record: ReplayRecord | None = None,
) -> Health:
    """Run the log through the pipeline as `controls` say, and show and count what comes out.

    With observers, which have controls, it stays after the end of the log until it is stopped; `publishers` have none.
    `record` keeps what came, for the page of --report.

    Raises:
        LogError, ConfigError: no frame was read, or none of them is mapped.
    """
    from canid import drive_reader, playback

    title = f"canid replay · {log.path.name} · {vehicle.name}"
    view = View(title, output=vehicle.driver.output, events=web_options.announced(observers))
    events: list[Event] = []
    state, frames, last = None, 0, 0.0
    terminal = display.display(view, json=args.json, controls=controls)
    shown = Shown([terminal, *observers, *publishers])
    interactive = bool(observers)
    timed = interactive or isinstance(terminal, display.LiveDisplay)
    duration = playback.Duration(log.path, args.stop) if timed else None
    steps = playback.play(
        log,
        vehicle,
        controls,
        start=args.start,
        stop=args.stop,
        keep=args.state,
        interactive=interactive,
        stays=bool(observers),
    )
    ended = False
    try:
        for item in steps:
            if isinstance(item, playback.Position):
                ended = item.ended
                shown.status(status(item, frames, duration.seconds if duration else None))
                continue
            if item.frames > frames:  # further than any earlier pass
                state, frames, last = item.step.state, item.frames, float(item.step.chunk.t[-1])
            for one in item.fresh:
                if record is not None:
                    record.put(one)
                if isinstance(one, Event):
                    events.append(one)
                if isinstance(one, SignalReport):
                    reports.append(one)
                    tally.distrust(one)
                if isinstance(one, Estimate):
                    tally.put(one)
                if isinstance(one, Estimate | MonitorReport | SignalReport):
                    display.write_json(sink, one)
            # after the files: what is seen has been written
            for one in item.step.out:
                shown.put(one)
            if item.step.out and isinstance(item.step.out[-1], Sample | Estimate | MonitorReport):
                shown.lines([HealthLine(f"{item.frames:,} frames")], vehicle.driver.output)
    except KeyboardInterrupt:
        if not ended:  # after the end it is how the page is closed
            raise
    finally:
        shown.close()
        if duration is not None:
            duration.close()
        steps.close()  # an interrupted replay saves its state as well
    # while --json is open: so that no empty file is left
    if not frames:
        raise drive_reader.nothing_read(args.log, args.start, args.stop, log.damage)
    health = drive_reader.health(log, vehicle, state, frames, last, events)
    if not health.mapped:
        raise drive_reader.nothing_mapped(args.log, vehicle, frames)
    return health


class Shown:
    """The display and the observers of a replay. An observer that raises is left out; the display, the first, is not."""

    def __init__(self, outputs: Sequence[display.Observer]) -> None:
        """Take the display and the observers."""
        self._display = outputs[0]
        self._observers = list(outputs[1:])

    def put(self, item: display.Item) -> None:
        """Show one output."""
        self._display.put(item)
        self._each("put", item)

    def lines(self, lines: Sequence[HealthLine], output: str) -> None:
        """Show the state of the reading."""
        self._display.lines(lines, output)
        self._each("lines", lines, output)

    def status(self, values: dict[str, Any]) -> None:
        """Show the position."""
        self._display.status(values)
        self._each("status", values)

    def close(self) -> None:
        """Close all."""
        self._display.close()
        self._each("close")

    def _each(self, what: str, *values: object) -> None:
        for observer in [*self._observers]:
            try:
                getattr(observer, what)(*values)
            except Exception as error:  # of any kind: the replay goes on without it
                self._observers.remove(observer)
                info(f"{type(observer).__name__} has failed ({type(error).__name__}: {error})")


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


def onto(args: argparse.Namespace) -> int:
    """Send the log to a virtual bus."""
    from canid.buses.send import onto as send
    from canid.drive_reader import window
    from canid.logs import open_log
    from canid.views import json_values

    json = options.json_output(args)
    outputs.check([json], options.read_by(args))
    log = open_log(args.log)
    frames = window(log, args.start, args.stop)
    with outputs.opened(json) as sink:
        sent = send(args, frames, speed=args.speed or 1.0, arm=args.arm)
        if sink is not None:
            sink.write(json_values.document("onto", {"log": args.log, "sent": sent}) + "\n")
    info(f"{sent:,} frames of {args.log} sent")
    return DAMAGED if log.damage else DONE
