"""`canid diagnose LOG...`: what the simulation gets wrong, the cause, and what a better model gains."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canid.ui.cli.command_line import PART, READ_BY, reproducing
from canid.ui.cli.inputs import drive_source, reading
from canid.ui.cli.options import options
from canid.ui.cli.options.report_option import page_name
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, line_printer
from canid.ui.terminal.progress import Progress
from canid.values.errors import CHECK_FAILED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.analysis.drive.drive_reader import Drive
    from canid.signals.vehicle import Vehicle
    from canid.ui.cli.inputs.drive_source import Car
    from canid.values.findings import Report

# what the text ends with
MORE = "all of it: --details; with plots: --report"
# that change a report
OPTIONS = (*READ_BY, "--same", *PART, "--rivals")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", metavar="LOG", nargs="+", help=options.LOGS)
    options.time_zone(parser)
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    options.part(parser)
    options.json_file(parser)
    parser.add_argument(
        "-o",
        "--report",
        metavar="FILE.html",
        nargs="?",
        const="",
        help="write the diagnosis as an HTML page with plots; default name: LOG.diagnosis.html in the current folder; "
        "replaces an earlier page",
    )
    parser.add_argument(
        "--rivals",
        action="store_true",
        help="calibrate published car-following models (IDM, FVDM, OVRV, Gipps) on the same drive and compare them in "
        "closed loop; some 2 s per 10 min",
    )
    parser.add_argument(
        "--same",
        choices=("driver", "car"),
        help="diagnose all logs together. driver: one driver in one car, one report; car: sensors and car on all drives "
        "together, each driver on the own drive, one report per log",
    )
    parser.add_argument(
        "--details",
        action="store_true",
        help="print everything: evidence, blocks, parameters, model, checks; default: the answer on one screen",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="exit with 1 if a verdict is not adequate, a finding in the remnant alone excepted (for CI); "
        "a damaged log still exits with 4",
    )


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    from canid.ui.views.diagnosis_report.diagnosis_json import Diagnosis

    return {"diagnose": Diagnosis}


def run(args: argparse.Namespace) -> int:
    """Diagnose."""
    from canid.analysis.drive import identification_json
    from canid.ui.cli.provenance import provenance
    from canid.ui.views.diagnosis_report import diagnosis_answer, diagnosis_json, diagnosis_text
    from canid.ui.views.diagnosis_report.diagnosis_document import page
    from canid.ui.views.document.document_text import WIDTH
    from canid.values.findings import Verdict, extends
    from canid.values.text import json_values

    # logs that make one report
    together = args.same == "driver"
    groups: list[tuple[str, ...]] = [tuple(args.logs)] if together else [(log,) for log in args.logs]
    named = [f"{Path(args.logs[0]).stem}_together"] if together else args.logs
    pages = report_names(named, args.report)
    json = options.json_output(args)
    reports: list[Output | None] = [Output("--report", name, output_kinds.PAGE) for name in pages.values()]
    reports = reports or [None] * len(groups)
    outputs.check([json, *reports], options.read_by(args))
    car = drive_source.car(args, "diagnose")
    show = line_printer(args.json)
    objects = []
    damaged = DONE
    adequate = True
    with complete_files.opened(json) as sink:
        diagnosed = (
            diagnosed_together(args, car) if args.same == "car" else diagnosed_in_turn(args, car, groups)
        )
        for k, (logs, target, (drives, vehicle, report)) in enumerate(
            zip(groups, reports, diagnosed, strict=True)
        ):
            name, read = ", ".join(logs), args.logs if args.same else logs
            command = reproducing(args, "diagnose", *read, options=OPTIONS)
            report = report._replace(provenance=provenance(logs, vehicle, command))
            text = (
                diagnosis_text.text(report, name, vehicle.name, WIDTH)
                if args.details
                else diagnosis_answer.summary(report, name, vehicle.name, MORE)
            )
            for line in [""] * (k > 0) + text:
                show(line)
            of_log = identification_json.OfLog(damage=reading.damage(drives))
            objects.append(diagnosis_json.document(report, name, vehicle.name, of_log))
            # after the verdict: a full disk must not lose it; an earlier page is replaced only by a whole one
            complete_files.write(target, partial(page, report, vehicle.name))
            if target is not None:
                info(f"{target.path} written")
            for drive in drives:
                damaged = reading.report_health(drive.health) or damaged
            has_cause = report.verdict in (Verdict.NAMED, Verdict.ONE_OF)
            adequate &= report.verdict is Verdict.ADEQUATE or (has_cause and not extends(report))
        if sink is not None:
            sink.write(json_values.document("diagnose", objects[0] if len(objects) == 1 else objects) + "\n")
    return damaged or (CHECK_FAILED if args.check and not adequate else DONE)


def diagnosed_in_turn(
    args: argparse.Namespace, car: Car, groups: list[tuple[str, ...]]
) -> Iterator[tuple[list[Drive], Vehicle, Report]]:
    """Read and diagnose one drive after the other, or several of one driver as one."""
    for logs in groups:
        read = [drive_source.read_drive(path, car, args, estimating=False) for path in logs]
        drives = [drive for drive, _ in read]
        traces = [drive.trace for drive in drives]
        settings = read[0][1].estimators
        with Progress(f"diagnosing {', '.join(logs)}") as bar:
            if args.same:
                from canid.models.diagnosis.diagnose import diagnose_drives

                report = diagnose_drives(
                    traces, args.logs, rivals=args.rivals, estimators=settings, progress=bar.to
                )
            else:
                from canid.models.diagnosis.diagnose import diagnose

                report = diagnose(traces[0], rivals=args.rivals, estimators=settings, progress=bar.to)
        yield drives, read[0][1], report


def diagnosed_together(args: argparse.Namespace, car: Car) -> Iterator[tuple[list[Drive], Vehicle, Report]]:
    """Read all drives of one car and diagnose them, sensors and car on all of them."""
    from canid.models.diagnosis.diagnose import diagnose_car

    read = [drive_source.read_drive(path, car, args, estimating=False) for path in args.logs]
    drives = [drive for drive, _ in read]
    with Progress(f"diagnosing {len(drives)} drives of one car") as bar:
        traces = [drive.trace for drive in drives]
        settings = read[0][1].estimators
        reports = diagnose_car(traces, args.logs, rivals=args.rivals, estimators=settings, progress=bar.to)
    for (drive, vehicle), report in zip(read, reports, strict=True):
        yield [drive], vehicle, report


def report_names(logs: list[str], asked: str | None) -> dict[str, str]:
    """The page of each log.

    Args:
        logs: as given.
        asked: the argument of --report; "": without a name; None: not given.

    Raises:
        ConfigError: the name is not that of a page, or two logs would write the same page.

    Example:
        >>> report_names(["drives/a.blf"], "")
        {'drives/a.blf': 'a.diagnosis.html'}
    """
    if asked is None:
        return {}
    if asked and len(logs) > 1:
        raise ConfigError(
            "diagnose: --report takes a name for one log only; without a name each log gets its own page"
        )
    pages = {log: page_name("diagnose", asked, log, "diagnosis") for log in logs}
    twice = [page for page, count in Counter(pages[log] for log in logs).items() if count > 1]
    if twice:
        raise ConfigError(
            f"diagnose: two logs would write {twice[0]}; run diagnose for each, with a name after --report"
        )
    return pages
