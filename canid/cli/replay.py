"""`canid replay LOG`: the live view from a log; with --onto, the log onto a virtual bus."""

from __future__ import annotations

import argparse
import time

from canid.cli import options, output_kinds, outputs, show
from canid.cli.outputs import Output
from canid.cli.talk import talk, teller
from canid.errors import DAMAGED, DONE, ConfigError
from canid.types import Estimate, Event, Sample, Screened
from canid.views.screen import BusLine, View


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.vehicle(parser, required=False)
    parser.add_argument("--speed", type=options.speed, metavar="1|10|max", help="default: max; onto a bus: 1")
    options.part(parser)
    options.state(parser)
    options.json_file(parser)
    parser.add_argument("--onto", action="store_true", help="send the log to a virtual bus (-i, -c) instead")
    parser.add_argument("--arm", metavar="CHANNEL", help="with --onto: this physical channel may be sent to")
    from canid.frames.command_line import add_bus_arguments

    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Replay."""
    if args.onto:
        if args.state is not None:
            raise ConfigError("replay: --onto sends a log and estimates nothing; leave out --state")
        return onto(args)
    if args.vehicle is None:
        raise ConfigError("replay needs --vehicle V.toml (`canid init FILE.dbc` proposes one)")
    from canid import logs
    from canid.frames import open_log
    from canid.vehicle import read_vehicle
    from canid.views import summary

    json = options.json_output(args)
    state = Output("--state", args.state, output_kinds.STATE) if args.state else None
    outputs.check([json, state], options.read_by(args))
    vehicle = read_vehicle(args.vehicle)
    for warning in vehicle.warnings:
        talk(warning)
    log = open_log(args.log)
    view = View(f"canid replay · {log.path.name} · {vehicle.name}", output=vehicle.driver.output)
    tally = summary.Tally()
    events: list[Event] = []
    reached, frames, last = None, 0, 0.0
    speed = args.speed or float("inf")
    with outputs.opened(json) as sink:
        screen = show.display(view, json=args.json)
        began = time.monotonic()
        steps = logs.run(log, vehicle, start=args.start, stop=args.stop, keep=args.state)
        try:
            for after, frame, out in steps:
                reached = after
                if frames == 0:
                    began -= frame.t / speed
                frames += 1
                last = frame.t
                ahead = began + frame.t / speed - time.monotonic()
                if ahead > 0:
                    time.sleep(ahead)
                for item in out:
                    screen.put(item)
                    if isinstance(item, Estimate):
                        tally.put(item)
                        show.write_json(sink, item)
                    elif isinstance(item, Screened):
                        show.write_json(sink, item)
                    elif isinstance(item, Event):
                        events.append(item)
                if out and isinstance(out[-1], Sample | Estimate | Screened):
                    at = f"{100 * log.progress:.0f} % of the log"
                    screen.lines([BusLine(f"{frames:,} frames   {at}")])
        finally:
            screen.close()
            steps.close()  # an interrupted replay saves its state, too
        if not frames:
            # inside: so that no empty JSON file is left
            raise logs.nothing_read(args.log, args.start, args.stop, log.damage)
    found = logs.health(log, vehicle, reached, frames, last, events)
    if not found.mapped:
        raise logs.nothing_mapped(args.log, vehicle, frames)
    tell = teller(args.json)
    tell("")
    tell(f"{args.log}: {last:.1f} s, {frames:,} frames, vehicle {vehicle.name}")
    for line in summary.estimates(tally):
        tell(line)
    for line in summary.health(found.damage, found.back_in_time, found.counters, found.missing):
        talk(line)
    return DAMAGED if found.damage or found.back_in_time else DONE


def onto(args: argparse.Namespace) -> int:
    """Send the log to a virtual bus."""
    from canid.frames import open_log
    from canid.frames.send import onto as send
    from canid.logs import window
    from canid.views import as_json

    json = options.json_output(args)
    outputs.check([json], options.read_by(args))
    log = open_log(args.log)
    frames = window(log, args.start, args.stop)
    with outputs.opened(json) as sink:
        sent = send(args, frames, speed=args.speed or 1.0, arm=args.arm)
        if sink is not None:
            sink.write(as_json.line({"log": args.log, "sent": sent}) + "\n")
    talk(f"{sent:,} frames of {args.log} sent")
    return DAMAGED if log.damage else DONE
