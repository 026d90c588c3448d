"""`canid check [LOG]`: whether a vehicle file fits a log or a bus, and what is missing."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from canid.ui.cli.command_line import reproducing
from canid.ui.cli.inputs import drive_source, reading
from canid.ui.cli.options import options, report_option
from canid.ui.cli.output import complete_files, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, line_printer
from canid.ui.terminal.progress import Progress
from canid.values.bus_names import bus_text
from canid.values.errors import CHECK_FAILED, DAMAGED, DONE, ConfigError
from canid.values.window import WHOLE

if TYPE_CHECKING:
    from canid.analysis.drive.vehicle_check import Check
    from canid.io.logs import Log
    from canid.signals.vehicle import Vehicle
    from canid.ui.views.check_json import CheckedVehicle, CheckJson, Ids
    from canid.values.types import Columns, Damage


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.io.buses.command_line import add_bus_arguments

    parser.add_argument(
        "log",
        metavar="LOG",
        nargs="?",
        help="log to check; without LOG: the bus of -i and -c, or the vehicle file alone",
    )
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    options.listening(parser)
    report_option.add(parser, "write the check as an HTML page with plots")
    options.time_zone(parser)
    options.json_file(parser)
    add_bus_arguments(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    from canid.ui.views.check_json import CheckJson

    return {"check": CheckJson}


def run(args: argparse.Namespace) -> int:
    """Check."""
    from canid.analysis.drive.drive_reader import FRAMES_PER_CHUNK, errors_alone, nothing_read
    from canid.io.buses.bus import interfaces
    from canid.io.buses.bus_opener import open_buses
    from canid.io.buses.command_line import configs_of, listen, named
    from canid.io.logs import open_log
    from canid.signals.vehicle import on_buses
    from canid.values.frame_columns import chunks, gather

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
    numbers: dict[str, int] = {}
    if table:
        log, vehicle = drive_source.opened(args.log, car)
    else:
        log = open_log(args.log) if args.log else None
    counts: Counter[bool] = Counter()
    with Progress(f"reading {args.log}" if log else f"listening for {args.duration:g} s") as bar:
        if log is None:
            buses = open_buses(configs_of(args))
            numbers = interfaces(buses)
            vehicle = vehicle if vehicle is None else on_buses(vehicle, numbers)
            frames = reading.counted(listen(buses, args.duration, info), counts)
            text, values, checked = check_frames(chunks(frames), vehicle, whole=False)
        else:
            vehicle = vehicle if vehicle is None else reading.on_buses(vehicle, log)
            read = gather(log.columns(), FRAMES_PER_CHUNK)
            text, values, checked = check_frames(read, vehicle, lambda _: bar.to(log.progress))
    if log and not values.frames:
        raise nothing_read(args.log, WHOLE, log.damage)
    if log is not None:
        numbers = dict(log.buses)
    if numbers:
        text.insert(1, bus_text(numbers))
    show(args, text, values)
    if log is None and not counts[False]:
        return reading.report_silence(args.duration, counts[True])
    if report is not None and checked is not None and vehicle is not None:
        write_page(args, report, checked, vehicle, log.damage if log else None)
    if log:
        reading.report_log(log)
        if not table and (says := errors_alone(args.log)):
            info(says)
    if log and log.damage:
        info(log.damage.says)
        return DAMAGED
    return CHECK_FAILED if checked is not None and checked.problems else DONE


def check_frames(
    frames: Iterable[Columns],
    vehicle: Vehicle | None,
    on_time: Callable[[float], None] | None = None,
    *,
    whole: bool = True,
) -> tuple[list[str], CheckedVehicle | Ids, Check | None]:
    """Check frames against a vehicle, or list their ids without one; returns text, JSON and the check.

    `whole`: they are those of a log, not of a bus for some seconds.
    """
    from canid.analysis.drive.vehicle_check import check, contents
    from canid.ui.views import check_document, check_json

    if vehicle is None:
        ids = contents(frames, on_time)
        return check_document.contents(ids), check_json.ids(ids), None
    checked = check(frames, vehicle, on_time, whole=whole)
    return check_document.text(checked), check_json.checked(checked), checked


def write_page(
    args: argparse.Namespace, report: Output, checked: Check, vehicle: Vehicle, damage: Damage | None
) -> None:
    """Write the page of a check."""
    from canid.models.pipeline.pipeline import DT
    from canid.ui.cli.provenance import provenance
    from canid.ui.views import check_document
    from canid.ui.views.document.document import Source

    logs = [args.log] if args.log else []
    made_from = provenance(logs, vehicle, reproducing(args, "check", *logs))
    wrong = [damage.says] if damage else []
    shown = check_document.CheckedLog(checked, DT, Source(made_from, vehicle.name, wrong, damage is not None))
    complete_files.write(report, lambda: check_document.page(shown))
    info(f"{report.path} written")


def check_alone(args: argparse.Namespace, vehicle: Vehicle | None) -> int:
    """Check the vehicle file alone; without one, list the bus interfaces."""
    from canid.io.buses.listen_only import interfaces
    from canid.ui.views.check_json import Interfaces, VehicleAlone

    if vehicle is None:
        known = list(interfaces())
        text = ["python-can's interfaces, and whether each can be set to listen-only:", *known]
        show(args, text, Interfaces(tuple(known)))
    else:
        n = len(vehicle.roles)
        text = [args.vehicle, f"valid; {n} roles mapped, output {vehicle.driver.output}"]
        show(args, text, VehicleAlone(tuple(vehicle.roles), vehicle.driver.output))
    return DONE


def show(args: argparse.Namespace, text: list[str], values: CheckJson) -> None:
    """Print the lines, and write the JSON."""
    from canid.values.text.json_values import document

    print_line = line_printer(args.json)
    for each in text:
        print_line(each)
    complete_files.write(options.json_output(args), lambda: document("check", values) + "\n")
