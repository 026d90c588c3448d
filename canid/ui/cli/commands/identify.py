"""`canid identify LOG...`: the driver's parameters of a drive, as text, JSON and a page."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from canid.ui.cli.command_line import reproducing
from canid.ui.cli.inputs import drive_source, reading
from canid.ui.cli.options import options, report_option
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, line_printer
from canid.ui.terminal.progress import Progress
from canid.values.errors import CHECK_FAILED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.analysis.drive.drive_parameters import Identified
    from canid.analysis.drive.drive_reader import Drive
    from canid.signals.vehicle import Vehicle
    from canid.ui.views.identification_document import IdentifiedLog


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", metavar="LOG", nargs="+", help=options.LOGS)
    options.time_zone(parser)
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
    parser.add_argument(
        "--require",
        metavar="REQUIREMENT",
        action="append",
        default=[],
        help='exit with 1 if the drive does not meet it: "range_rate.K in 3..8" (K, tau, dead_time, tau_plus_dead_time of '
        'an input) or "fit_percent in 50..100"; what may not be quoted does not meet it; repeatable',
    )
    parser.add_argument(
        "--junit",
        metavar="FILE.xml",
        help="write how each log meets each --require as JUnit XML, for a CI server",
    )
    options.json_file(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    from canid.analysis.drive.identification_json import Identification

    return {"identify": Identification}


def run(args: argparse.Namespace) -> int:
    """Identify."""
    from canid.analysis.drive import identification_json, identification_verdict
    from canid.analysis.drive.drive_parameters import identify, windows
    from canid.analysis.drive.requirements import judged, requirement
    from canid.ui.views import identification_text, junit
    from canid.ui.views.drive_report import level_plot
    from canid.values.text import json_values

    if args.plot and len(args.logs) > 1:
        raise ConfigError("identify: --plot takes one log; run identify for each")
    required = [requirement(text) for text in args.require]
    if args.junit and not required:
        raise ConfigError("identify: --junit shows what --require asks for; name at least one requirement")
    json = options.json_output(args)
    plot = Output("--plot", args.plot, output_kinds.PLOT) if args.plot else None
    report = report_option.output(args, "identify")
    result = Output("--junit", args.junit, output_kinds.JUNIT) if args.junit else None
    outputs.check([json, plot, report, result], options.read_by(args))
    car = drive_source.car(args, "identify")
    show = line_printer(args.json)
    objects, verdicts, drives, met = [], [], [], []
    # the windows and the other orders of ARMAX take three quarters of the time
    full = args.windows or bool(args.plot or args.json) or report is not None
    code = DONE
    with complete_files.opened(json) as sink:
        for k, path in enumerate(args.logs):
            drive, vehicle = drive_source.read_drive(path, car, args, estimating=False)
            output = vehicle.driver.output
            with Progress(f"identifying {path}"):
                identified = identify(drive.trace, select_orders=full, sliding=full, **vehicle.estimators)
                if not (full or identification_verdict.verdict(identified, output).identifiable):
                    # what most windows lack is the reason then
                    along = tuple(windows(drive.trace, **vehicle.estimators))
                    identified = identified._replace(windows=along)
            lines = identification_text.summary(identified, path, vehicle.name, output, _where(args))
            if args.windows:
                lines = [*identification_text.text(identified, path, vehicle.name, output), "", *lines]
            for line in [""] * (k > 0) + lines:
                show(line)
            met.append(junit.JudgedLog(path, tuple(judged(required, identified, output))))
            for case in met[-1].cases:
                show(f"{'✗' if case.failed else '✓'} {case.requirement.text}: {case.failed or case.says}")
            of_log = identification_json.OfLog(damage=reading.damage([drive]))
            objects.append(identification_json.document(identified, path, vehicle.name, of_log))
            verdicts.append(identification_verdict.verdict(identified, output))
            complete_files.write(plot, partial(level_plot.svg, identified, path, vehicle.name))
            if report is not None:
                drives.append(_of_page(args, path, vehicle, drive, identified))
            code = reading.report_health(drive.health, path if len(args.logs) > 1 else "") or code
        if len(verdicts) > 1:
            named = zip(args.logs, (drive_verdict.title for drive_verdict in verdicts), strict=True)
            for line in ["", *identification_text.several(named)]:
                show(line)
        if sink is not None:
            sink.write(json_values.document("identify", objects[0] if len(objects) == 1 else objects) + "\n")
    # after the numbers: a full disk must not lose them
    complete_files.write(result, lambda: junit.xml(met))
    if report is not None:
        from canid.ui.views import identification_document

        complete_files.write(report, lambda: identification_document.page(drives))
        info(f"{report.path} written")
    failed = args.check and not all(drive_verdict.identifiable for drive_verdict in verdicts)
    failed |= any(case.failed for log in met for case in log.cases)
    return code or (CHECK_FAILED if failed else DONE)


def _where(args: argparse.Namespace) -> str:
    """Which options show the estimates over sliding windows, of those that were not given."""
    ways = [] if args.windows else ["print them with --windows"]
    return ", ".join(
        ways if args.windows or args.report is not None else [*ways, "see all with --report FILE.html"]
    )


def _of_page(
    args: argparse.Namespace, path: str, vehicle: Vehicle, drive: Drive, identified: Identified
) -> IdentifiedLog:
    """What the page shows of one log."""
    from canid.analysis.drive.drive_series import drive_series
    from canid.analysis.drive.held_out_simulation import held_out
    from canid.ui.views.identification_document import IdentifiedLog

    series = drive_series(drive.trace, identified, **vehicle.estimators)
    source = reading.source(path, vehicle, reproducing(args, "identify", *args.logs), drive.health)
    rest = held_out(drive.trace, **vehicle.estimators)
    return IdentifiedLog(identified, drive.trace, vehicle.driver.output, series, source, rest)
