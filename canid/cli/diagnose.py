"""`canid diagnose LOG...`: what the simulation gets wrong, the cause, and what a better model gains."""

from __future__ import annotations

import argparse
import shlex
from collections import Counter
from pathlib import Path

from canid.cli import options, reading
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import Output
from canid.cli.output.progress import Progress
from canid.errors import CHECK_FAILED, DONE, ConfigError

# with any other suffix `--report LOG` (the name forgotten, the log taken for it) could write over a log
PAGE_SUFFIXES = (".html", ".htm")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", metavar="LOG", nargs="+", help=options.LOGS)
    options.vehicle(parser)
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
        choices=("driver",),
        help="diagnose all logs together: one driver in one car, on several drives",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="exit with 1 if a verdict is not adequate, a finding in the remnant alone excepted (for CI); "
        "a damaged log still exits with 4",
    )


def run(args: argparse.Namespace) -> int:
    """Diagnose."""
    from canid.cli.provenance import provenance
    from canid.diagnosis.diagnose import diagnose
    from canid.findings import Verdict, extends
    from canid.views import diagnosis_json, diagnosis_text, json_values
    from canid.views.report import page

    if args.same:
        return run_together(args)
    pages = report_names(args.logs, args.report)
    json = options.json_output(args)
    reports = {log: Output("--report", name, output_kinds.PAGE) for log, name in pages.items()}
    outputs.check([json, *reports.values()], options.read_by(args))
    vehicle = reading.read_vehicle(args.vehicle)
    show = line_printer(args.json)
    objects = []
    damaged = DONE
    adequate = True
    with outputs.opened(json) as sink:
        for k, path in enumerate(args.logs):
            drive = reading.read_drive(path, vehicle, args, estimating=False)
            with Progress(f"diagnosing {path}") as bar:
                report = diagnose(drive.trace, rivals=args.rivals, progress=bar.to)
            report = report._replace(provenance=provenance(path, vehicle, command(args, path)))
            for line in [""] * (k > 0) + diagnosis_text.text(report, path, vehicle.name):
                show(line)
            objects.append(diagnosis_json.to_json(report, path, vehicle.name))
            # after the verdict: a full disk must not lose it; an earlier page is replaced only by a whole one
            with outputs.opened(reports.get(path)) as file:
                if file is not None:
                    file.write(page(report))
                    info(f"{pages[path]} written")
            damaged = reading.report_health(drive.health) or damaged
            named = report.verdict in (Verdict.NAMED, Verdict.ONE_OF)
            adequate &= report.verdict is Verdict.ADEQUATE or (named and not extends(report))
        if sink is not None:
            sink.write(json_values.line(objects[0] if len(objects) == 1 else objects) + "\n")
    return damaged or (CHECK_FAILED if args.check and not adequate else DONE)


def run_together(args: argparse.Namespace) -> int:
    """Diagnose all logs as drives of one driver."""
    from canid.cli.provenance import provenance
    from canid.diagnosis.diagnose import diagnose_drives
    from canid.findings import Verdict, extends
    from canid.views import diagnosis_json, diagnosis_text, json_values
    from canid.views.report import page

    name = report_names([f"{Path(args.logs[0]).stem}.together"], args.report)
    json = options.json_output(args)
    target = Output("--report", next(iter(name.values())), output_kinds.PAGE) if name else None
    outputs.check([json, target], options.read_by(args))
    vehicle = reading.read_vehicle(args.vehicle)
    show = line_printer(args.json)
    with outputs.opened(json) as sink:
        drives = [reading.read_drive(path, vehicle, args, estimating=False) for path in args.logs]
        with Progress(f"diagnosing {len(drives)} drives") as bar:
            report = diagnose_drives(
                [drive.trace for drive in drives], args.logs, rivals=args.rivals, progress=bar.to
            )
        logs = ", ".join(args.logs)
        asked = " ".join(shlex.quote(path) for path in args.logs)
        of = [provenance(path, vehicle, command(args, path)) for path in args.logs]
        report = report._replace(
            provenance=of[0]._replace(
                log=logs,
                log_sha256=", ".join(one.log_sha256 for one in of),
                command=f"canid diagnose {asked} --same driver --vehicle {args.vehicle}",
            )
        )
        for line in diagnosis_text.text(report, logs, vehicle.name):
            show(line)
        with outputs.opened(target) as file:
            if file is not None and target is not None:
                file.write(page(report))
                info(f"{target.path} written")
        damaged = DONE
        for drive in drives:
            damaged = reading.report_health(drive.health) or damaged
        if sink is not None:
            sink.write(json_values.line(diagnosis_json.to_json(report, logs, vehicle.name)) + "\n")
    named = report.verdict in (Verdict.NAMED, Verdict.ONE_OF)
    adequate = report.verdict is Verdict.ADEQUATE or (named and not extends(report))
    return damaged or (CHECK_FAILED if args.check and not adequate else DONE)


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
    if asked and Path(asked).suffix.lower() not in PAGE_SUFFIXES:
        raise ConfigError(f"diagnose: --report {asked} is not an .html file; put logs before --report")
    if asked and len(logs) > 1:
        raise ConfigError(
            "diagnose: --report takes a name for one log only; without a name each log gets its own page"
        )
    pages = {log: asked or f"{Path(log).stem}.diagnosis.html" for log in logs}
    twice = [page for page, count in Counter(pages[log] for log in logs).items() if count > 1]
    if twice:
        raise ConfigError(
            f"diagnose: two logs would write {twice[0]}; run diagnose for each, with a name after --report"
        )
    return pages


def command(args: argparse.Namespace, log: str) -> str:
    """The command that reproduces the report of one log.

    Example:
        >>> command(argparse.Namespace(vehicle="generic", start=0.0, stop=60.0, rivals=False), "drive 7.blf")
        "canid diagnose 'drive 7.blf' --vehicle generic --stop 60"
    """
    words = ["canid", "diagnose", log, "--vehicle", str(args.vehicle)]
    words += ["--start", f"{args.start:g}"] if args.start > 0 else []
    words += ["--stop", f"{args.stop:g}"] if args.stop < float("inf") else []
    words += ["--rivals"] if args.rivals else []
    return shlex.join(words)
