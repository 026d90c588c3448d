"""`canid check [LOG]`: does the vehicle file fit this log or bus, and what is missing."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from canid.cli import options, show
from canid.errors import CHECK_FAILED, DAMAGED, DONE
from canid.types import Frame


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.frames.command_line import add_bus_arguments

    parser.add_argument(
        "log", metavar="LOG", nargs="?", help="a log; without one, a bus (-i, -c) or the file alone"
    )
    options.vehicle(parser, required=False)
    parser.add_argument(
        "--duration", type=options.seconds, default=5.0, metavar="S", help="how long to listen"
    )
    options.json_file(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Check."""
    from canid.check import check
    from canid.frames import open_log
    from canid.frames.command_line import named
    from canid.vehicle import read_vehicle
    from canid.views import table
    from canid.views.as_json import line

    damage = None
    vehicle = read_vehicle(args.vehicle) if args.vehicle else None
    for warning in vehicle.warnings if vehicle else ():
        options.talk(warning)
    tell = options.talk if args.json == "-" else print
    if args.log:
        log = open_log(args.log)
        if vehicle is None:
            for text in table.contents(log):
                tell(text)
            return DAMAGED if log.damage else DONE
        bar = show.Progress(f"reading {args.log}")
        try:
            found = check(log, vehicle, lambda _: bar.to(log.progress))
        finally:
            bar.close()
        damage = log.damage
    elif named(args):
        if vehicle is None:
            for text in table.contents(listen(args)):
                tell(text)
            return DONE
        found = check(listen(args), vehicle)
    elif vehicle is not None:
        tell(f"{args.vehicle}: in order; {len(vehicle.roles)} roles mapped, output {vehicle.driver.output}")
        return DONE
    else:
        from canid.frames.listen_only import interfaces

        for text in interfaces():
            tell(text)
        return DONE
    for text in table.check(found):
        tell(text)
    with options.sink(args.json) as sink:
        if sink is not None:
            sink.write(line(table.check_json(found)) + "\n")
    if damage:
        options.talk(damage.says)
        return DAMAGED
    return CHECK_FAILED if found.problems else DONE


def listen(args: argparse.Namespace) -> Iterator[Frame]:
    """Frames of the bus for --duration."""
    from canid.frames.command_line import listen as listen_to

    return listen_to(args, args.duration)
