"""`canid identify LOG...`: the driver's parameters of a drive, as text, JSON and a page."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from canid.cli import drive_source, options, reading, report_option
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import Output
from canid.cli.output.progress import Progress
from canid.errors import CHECK_FAILED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.drive_parameters import Identified
    from canid.drive_reader import Drive
    from canid.vehicle import Vehicle
    from canid.views.drive_report.identify_page import IdentifiedLog


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", metavar="LOG", nargs="+", help=options.LOGS)
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    options.part(parser)
    parser.add_argument(
        "--windows",
        action="store_true",
        help="print the estimates over sliding windows and every model in full as well",
    )
    report_option.add(
        parser, "write the drive as an HTML page with plots; several logs are sections of one page"
    )
    parser.add_argument(
        "--plot",
        metavar="FILE.svg",
        help="of one log, draw the parameters over the drive; an existing file is replaced only if it is such a plot",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="exit with 1 if nothing is identifiable in one of the logs (for CI); a damaged log still exits with 4",
    )
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Identify."""
    from canid.drive_parameters import identify
    from canid.views import (
        identification_json,
        identification_summary,
        identification_text,
        identification_verdict,
        json_values,
        level_plot,
    )

    if args.plot and len(args.logs) > 1:
        raise ConfigError("identify: --plot takes one log; run identify for each")
    json = options.json_output(args)
    plot = Output("--plot", args.plot, output_kinds.PLOT) if args.plot else None
    report = report_option.output(args, "identify")
    outputs.check([json, plot, report], options.read_by(args))
    car = drive_source.car(args, "identify")
    show = line_printer(args.json)
    objects, verdicts, drives = [], [], []
    code = DONE
    with outputs.opened(json) as sink:
        for k, path in enumerate(args.logs):
            drive, vehicle = drive_source.read_drive(path, car, args, estimating=False)
            output = vehicle.driver.output
            with Progress(f"identifying {path}"):
                identified = identify(drive.trace, **vehicle.estimators)
            lines = identification_summary.summary(identified, path, vehicle.name, output, _where(args))
            if args.windows:
                lines = [*identification_text.text(identified, path, vehicle.name, output), "", *lines]
            for line in [""] * (k > 0) + lines:
                show(line)
            objects.append(identification_json.to_json(identified, path, vehicle.name))
            verdicts.append(identification_verdict.verdict(identified, output))
            with outputs.opened(plot) as file:
                if file is not None:
                    file.write(level_plot.svg(identified, path, vehicle.name))
            if report is not None:
                drives.append(_of_page(args, path, vehicle, drive, identified))
            code = reading.report_health(drive.health, path if len(args.logs) > 1 else "") or code
        if len(verdicts) > 1:
            named = zip(args.logs, (of.title for of in verdicts), strict=True)
            for line in ["", *identification_summary.several(named)]:
                show(line)
        if sink is not None:
            sink.write(json_values.document("identify", objects[0] if len(objects) == 1 else objects) + "\n")
    # after the numbers: a full disk must not lose them
    if report is not None:
        from canid.views.drive_report import identify_page

        with outputs.opened(report) as file:
            if file is not None:
                file.write(identify_page.page(drives))
        info(f"{report.path} written")
    failed = args.check and not all(of.identifiable for of in verdicts)
    return code or (CHECK_FAILED if failed else DONE)


def _where(args: argparse.Namespace) -> str:
    """Which options show the estimates over sliding windows, of those that were not given."""
    ways = [] if args.windows else ["print them with --windows"]
    return ", ".join(ways if args.windows or args.report else [*ways, "see all with --report FILE.html"])


def _of_page(
    args: argparse.Namespace, path: str, vehicle: Vehicle, drive: Drive, identified: Identified
) -> IdentifiedLog:
    """What the page shows of one log."""
    from canid.cli.provenance import provenance
    from canid.drive_series import drive_series
    from canid.views import end_summary
    from canid.views.drive_report.identify_page import IdentifiedLog

    health = drive.health
    return IdentifiedLog(
        identified,
        drive.trace,
        vehicle.driver.output,
        drive_series(drive.trace, identified, **vehicle.estimators),
        end_summary.health(health.damage, health.back_in_time, health.counters, health.missing),
        provenance([path], vehicle, report_option.command(args, "identify", *args.logs)),
        vehicle.name,
        bool(health.damage or health.back_in_time),
    )
