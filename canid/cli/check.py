"""`canid check [LOG]`: does the vehicle file fit this log or bus, and what is missing."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

from canid.cli import options, outputs, progress
from canid.cli.talk import talk, teller
from canid.errors import CHECK_FAILED, DAMAGED, DONE
from canid.types import Frame

if TYPE_CHECKING:
    from canid.vehicle import Vehicle


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.frames.command_line import add_bus_arguments

    parser.add_argument(
        "log", metavar="LOG", nargs="?", help="a log; without one, a bus (-i, -c) or the file alone"
    )
    options.vehicle(parser, required=False)
    parser.add_argument(
        "--duration",
        type=options.seconds,
        default=5.0,
        metavar="S",
        help="how long to listen to a bus; default: 5",
    )
    options.json_file(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Check."""
    from canid.frames import open_log
    from canid.frames.command_line import named
    from canid.logs import nothing_read
    from canid.vehicle import read_vehicle

    outputs.check([options.json_output(args)], options.read_by(args))
    vehicle = read_vehicle(args.vehicle) if args.vehicle else None
    for warning in vehicle.warnings if vehicle else ():
        talk(warning)
    if not args.log and not named(args):
        return alone(args, vehicle)
    log = open_log(args.log) if args.log else None
    bar = progress.Progress(f"reading {args.log}" if log else f"listening for {args.duration:g} s")
    try:
        if log is None:
            text, told, problems = look(listen(args), vehicle)
        else:
            text, told, problems = look(log, vehicle, lambda _: bar.to(log.progress))
    finally:
        bar.close()
    if log and not told["frames"]:
        raise nothing_read(args.log, 0.0, float("inf"), log.damage)
    say(args, text, told)
    if log and log.others_says:
        talk(f"no CAN frames: {log.others_says}")
    if log and log.damage:
        talk(log.damage.says)
        return DAMAGED
    return CHECK_FAILED if problems else DONE


def look(
    frames: Iterable[Frame], vehicle: Vehicle | None, on_time: Callable[[float], None] | None = None
) -> tuple[list[str], dict[str, Any], int]:
    """What the frames hold, for this vehicle or for none: lines, the same as JSON, and how many problems."""
    from canid.check import check, contents
    from canid.views import table

    if vehicle is None:
        seen = contents(frames, on_time)
        return table.contents(seen), table.contents_json(seen), 0
    found = check(frames, vehicle, on_time)
    return table.check(found), table.check_json(found), len(found.problems)


def alone(args: argparse.Namespace, vehicle: Vehicle | None) -> int:
    """Without log and bus: is the vehicle file in order, or what buses could there be."""
    from canid.frames.listen_only import interfaces

    if vehicle is None:
        known = list(interfaces())
        text = ["python-can's interfaces, and whether they can be made to listen only:", *known]
        say(args, text, {"interfaces": known})
    else:
        n = len(vehicle.roles)
        text = [f"{args.vehicle}: in order; {n} roles mapped, output {vehicle.driver.output}"]
        say(args, text, {"roles": list(vehicle.roles), "output": vehicle.driver.output})
    return DONE


def say(args: argparse.Namespace, text: list[str], told: dict[str, Any]) -> None:
    """Print the lines, and write the JSON."""
    from canid.views.as_json import line

    tell = teller(args.json)
    for each in text:
        tell(each)
    with outputs.opened(options.json_output(args)) as sink:
        if sink is not None:
            sink.write(line(told) + "\n")


def listen(args: argparse.Namespace) -> Iterator[Frame]:
    """Frames of the bus for --duration."""
    from canid.frames.command_line import listen as listen_to

    return listen_to(args, args.duration, talk)
