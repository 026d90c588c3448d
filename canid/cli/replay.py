"""`canid replay LOG`: the live view of a recorded log; with --onto, the log sent to a virtual bus."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING

from canid.cli import options, reading
from canid.cli.output import display, output_kinds, outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import Output, TextOutput
from canid.errors import DAMAGED, DONE, ConfigError
from canid.types import Estimate, Event, MonitorReport, Sample, SignalReport
from canid.views.live_view import HealthLine, View

if TYPE_CHECKING:
    from canid.drive_reader import Health
    from canid.logs import Log
    from canid.vehicle import Vehicle
    from canid.views.end_summary import EstimateTally

# s of real time that a chunk lasts, as live
CHUNK_S = 0.05


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.buses.command_line import add_bus_arguments

    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.vehicle(parser, required=False)
    parser.add_argument(
        "--speed",
        type=options.speed,
        metavar="1|10|max",
        help="factor of real time, or max; default: max, with --onto: 1",
    )
    options.part(parser)
    options.state(parser)
    options.json_file(parser)
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
        return onto(args)
    if args.vehicle is None:
        raise ConfigError("replay needs --vehicle V.toml (`canid init FILE.dbc` proposes one)")
    from canid.logs import open_log
    from canid.signal_checks import signal_checks
    from canid.views import end_summary, signal_text

    json = options.json_output(args)
    state = Output("--state", args.state, output_kinds.STATE) if args.state else None
    outputs.check([json, state], options.read_by(args))
    vehicle = reading.read_vehicle(args.vehicle)
    log = open_log(args.log)
    tally = end_summary.EstimateTally()
    reports: list[SignalReport] = []
    with outputs.opened(json) as sink:
        health = play(args, log, vehicle, tally, reports, sink)
    show = line_printer(args.json)
    show("")
    show(f"{args.log}: {health.duration:.1f} s, {health.frames:,} frames, vehicle {vehicle.name}")
    for line in end_summary.estimates(tally):
        show(line)
    for line in signal_text.findings(signal_checks.episodes(reports)):
        show(line)
    return reading.report_health(health)


def play(
    args: argparse.Namespace,
    log: Log,
    vehicle: Vehicle,
    tally: EstimateTally,
    reports: list[SignalReport],
    sink: TextOutput | None,
) -> Health:
    """Run the log through the pipeline at --speed, and show and count what comes out.

    Raises:
        LogError, ConfigError: no frame was read, or none of them is mapped.
    """
    from canid import drive_reader

    view = View(f"canid replay · {log.path.name} · {vehicle.name}", output=vehicle.driver.output)
    events: list[Event] = []
    state, frames, last = None, 0, 0.0
    speed = args.speed or float("inf")
    shown = display.display(view, json=args.json)
    began = time.monotonic()
    steps = drive_reader.run(
        log, vehicle, start=args.start, stop=args.stop, keep=args.state, span=CHUNK_S * speed
    )
    try:
        for after, chunk, out in steps:
            state = after
            if frames == 0:
                began -= float(chunk.t[0]) / speed
            frames += len(chunk.t)
            last = float(chunk.t[-1])
            ahead = began + last / speed - time.monotonic()
            if ahead > 0:
                time.sleep(ahead)
            for item in out:
                shown.put(item)
                if isinstance(item, Event):
                    events.append(item)
                if isinstance(item, SignalReport):
                    reports.append(item)
                    tally.distrust(item)
                if isinstance(item, Estimate):
                    tally.put(item)
                if isinstance(item, Estimate | MonitorReport | SignalReport):
                    display.write_json(sink, item)
            if out and isinstance(out[-1], Sample | Estimate | MonitorReport):
                shown.lines([HealthLine(f"{frames:,} frames   {100 * log.progress:.0f} % of the log")])
    finally:
        shown.close()
        steps.close()  # an interrupted replay saves its state as well
    # while --json is open: so that no empty file is left
    if not frames:
        raise drive_reader.nothing_read(args.log, args.start, args.stop, log.damage)
    health = drive_reader.health(log, vehicle, state, frames, last, events)
    if not health.mapped:
        raise drive_reader.nothing_mapped(args.log, vehicle, frames)
    return health


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
            sink.write(json_values.line({"log": args.log, "sent": sent}) + "\n")
    info(f"{sent:,} frames of {args.log} sent")
    return DAMAGED if log.damage else DONE
