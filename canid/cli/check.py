"""`canid check [LOG]`: whether a vehicle file fits a log or a bus, and what is missing."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

from canid.cli import drive_source, options, report_option
from canid.cli.output import outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import Output
from canid.cli.output.progress import Progress
from canid.errors import CHECK_FAILED, DAMAGED, DONE, ConfigError
from canid.types import Frame

if TYPE_CHECKING:
    from canid.logs import Log
    from canid.types import Damage
    from canid.vehicle import Vehicle
    from canid.vehicle_check import Check


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.buses.command_line import add_bus_arguments

    parser.add_argument(
        "log",
        metavar="LOG",
        nargs="?",
        help="log to check; without LOG: the bus of -i and -c, or the vehicle file alone",
    )
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    parser.add_argument(
        "--duration",
        type=options.seconds,
        default=5.0,
        metavar="S",
        help="seconds to listen to the bus; default: 5",
    )
    report_option.add(parser, "write the check as an HTML page with plots")
    options.json_file(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Check."""
    from canid.buses.command_line import named
    from canid.drive_reader import nothing_read
    from canid.logs import open_log

    report = report_option.output(args, "check")
    car = drive_source.car(args, "check")
    table = bool(args.log) and drive_source.is_table(args.log)
    if report is not None and not table and (args.vehicle is None or not (args.log or named(args))):
        raise ConfigError("check: --report shows a vehicle file on a log or a bus; name both")
    outputs.check([options.json_output(args), report], options.read_by(args))
    vehicle = car.vehicle
    if not args.log and not named(args):
        return check_alone(args, vehicle)
    log: Log | None
    if table:
        log, vehicle = drive_source.opened(args.log, car)
    else:
        log = open_log(args.log) if args.log else None
    with Progress(f"reading {args.log}" if log else f"listening for {args.duration:g} s") as bar:
        if log is None:
            text, values, checked = check_frames(listen(args), vehicle)
        else:
            text, values, checked = check_frames(log, vehicle, lambda _: bar.to(log.progress))
    if log and not values["frames"]:
        raise nothing_read(args.log, 0.0, float("inf"), log.damage)
    show(args, text, values)
    if report is not None and checked is not None and vehicle is not None:
        write_page(args, report, checked, vehicle, log.damage if log else None)
    if log and log.others_says:
        info(f"no CAN frames: {log.others_says}")
    if log and log.damage:
        info(log.damage.says)
        return DAMAGED
    return CHECK_FAILED if checked is not None and checked.problems else DONE


def check_frames(
    frames: Iterable[Frame], vehicle: Vehicle | None, on_time: Callable[[float], None] | None = None
) -> tuple[list[str], dict[str, Any], Check | None]:
    """Check frames against a vehicle, or list their ids without one; returns text, JSON and the check."""
    from canid.vehicle_check import check, contents
    from canid.views import check_text

    if vehicle is None:
        found = contents(frames, on_time)
        return check_text.contents(found), check_text.contents_json(found), None
    checked = check(frames, vehicle, on_time)
    return check_text.check(checked), check_text.check_json(checked), checked


def write_page(
    args: argparse.Namespace, report: Output, checked: Check, vehicle: Vehicle, damage: Damage | None
) -> None:
    """Write the page of a check."""
    from canid.cli.provenance import provenance
    from canid.pipeline import DT
    from canid.views.drive_report import check_page

    logs = [args.log] if args.log else []
    command = report_option.command(args, "check", *logs)
    shown = check_page.CheckedLog(
        checked,
        DT,
        [damage.says] if damage else [],
        provenance(logs, vehicle, command),
        vehicle.name,
        damaged=damage is not None,
    )
    with outputs.opened(report) as file:
        if file is not None:
            file.write(check_page.page(shown))
    info(f"{report.path} written")


def check_alone(args: argparse.Namespace, vehicle: Vehicle | None) -> int:
    """Check the vehicle file alone; without one, list the bus interfaces."""
    from canid.buses.listen_only import interfaces

    if vehicle is None:
        known = list(interfaces())
        text = ["python-can's interfaces, and whether each can be set to listen-only:", *known]
        show(args, text, {"interfaces": known})
    else:
        n = len(vehicle.roles)
        text = [f"{args.vehicle}: valid; {n} roles mapped, output {vehicle.driver.output}"]
        show(args, text, {"roles": list(vehicle.roles), "output": vehicle.driver.output})
    return DONE


def show(args: argparse.Namespace, text: list[str], values: dict[str, Any]) -> None:
    """Print the lines, and write the JSON."""
    from canid.views.json_values import document

    print_line = line_printer(args.json)
    for each in text:
        print_line(each)
    with outputs.opened(options.json_output(args)) as sink:
        if sink is not None:
            sink.write(document("check", values) + "\n")


def listen(args: argparse.Namespace) -> Iterator[Frame]:
    """Frames of the bus for --duration."""
    from canid.buses.command_line import listen as listen_to

    return listen_to(args, args.duration, info)
