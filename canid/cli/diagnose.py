"""`canid diagnose LOG...`: what the simulation gets wrong, why, and what a better model gains."""

from __future__ import annotations

import argparse
import shlex
from collections import Counter
from pathlib import Path

from canid.cli import options, output_kinds, outputs, progress
from canid.cli.outputs import Output
from canid.cli.talk import talk, teller
from canid.errors import CHECK_FAILED, DAMAGED, DONE, ConfigError

# so that `--report LOG` (a name forgotten, the log taken for it) never writes over a log
PAGES = (".html", ".htm")


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
        help="write the diagnosis as one page with plots; without a name LOG.diagnosis.html in the current folder; "
        "what was there is replaced; without this option no file is written",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="exit 1 where a verdict is not adequate (for CI); a damaged log's 4 goes before it",
    )


def run(args: argparse.Namespace) -> int:
    """Diagnose."""
    from canid import logs
    from canid.cli.provenance import provenance
    from canid.diagnosis.diagnosing import diagnose
    from canid.findings import Verdict
    from canid.frames import open_log
    from canid.vehicle import read_vehicle
    from canid.views import as_json, diagnosed, summary
    from canid.views.report import page as written

    pages = report_names(args.logs, args.report)
    json = options.json_output(args)
    reports = {log: Output("--report", page, output_kinds.PAGE) for log, page in pages.items()}
    outputs.check([json, *reports.values()], options.read_by(args))
    vehicle = read_vehicle(args.vehicle)
    for warning in vehicle.warnings:
        talk(warning)
    tell = teller(args.json)
    objects = []
    damaged = inadequate = False
    with outputs.opened(json) as sink:
        for k, path in enumerate(args.logs):
            bar = progress.Progress(f"reading {path}")
            log = open_log(path)
            try:
                drive = logs.read_drive(
                    path,
                    vehicle,
                    estimating=False,
                    start=args.start,
                    stop=args.stop,
                    log=log,
                    progress=bar.to,
                )
            finally:
                bar.close()
            bar = progress.Progress(f"diagnosing {path}")
            try:
                report = diagnose(drive.trace)
            finally:
                bar.close()
            report = report._replace(provenance=provenance(path, vehicle, command(args, path)))
            for line in [""] * (k > 0) + diagnosed.text(report, path, vehicle.name):
                tell(line)
            objects.append(diagnosed.to_json(report, path, vehicle.name))
            # last: what was there is replaced only by a whole page, and a verdict is not lost with a full disk
            with outputs.opened(reports.get(path)) as file:
                if file is not None:
                    file.write(written(report))
                    talk(f"{pages[path]} written")
            found = drive.health
            for line in summary.health(found.damage, found.back_in_time, found.counters, found.missing):
                talk(line)
            damaged |= bool(found.damage or found.back_in_time)
            inadequate |= report.verdict is not Verdict.ADEQUATE
        if sink is not None:
            sink.write(as_json.line(objects[0] if len(objects) == 1 else objects) + "\n")
    if damaged:
        return DAMAGED
    return CHECK_FAILED if args.check and inadequate else DONE


def report_names(logs: list[str], asked: str | None) -> dict[str, str]:
    """Choose the page of each log.

    Args:
        logs: as given.
        asked: what --report was given; "" no name, None not at all.

    Raises:
        ConfigError: the name is no page's, or two logs would write the same page.

    Example:
        >>> report_names(["drives/a.blf"], "")
        {'drives/a.blf': 'a.diagnosis.html'}
    """
    if asked is None:
        return {}
    if asked and Path(asked).suffix.lower() not in PAGES:
        raise ConfigError(f"diagnose: --report {asked} is no .html file; logs come before --report")
    if asked and len(logs) > 1:
        raise ConfigError(
            "diagnose: --report takes a name for one log only; without a name each gets its own page"
        )
    pages = {log: asked or f"{Path(log).stem}.diagnosis.html" for log in logs}
    twice = [page for page, count in Counter(pages[log] for log in logs).items() if count > 1]
    if twice:
        raise ConfigError(f"diagnose: two logs would write {twice[0]}; diagnose them one by one, with names")
    return pages


def command(args: argparse.Namespace, log: str) -> str:
    """Spell the command that gives one log's report again.

    Example:
        >>> command(argparse.Namespace(vehicle="generic", start=0.0, stop=60.0), "drive 7.blf")
        "canid diagnose 'drive 7.blf' --vehicle generic --stop 60"
    """
    words = ["canid", "diagnose", log, "--vehicle", str(args.vehicle)]
    words += ["--start", f"{args.start:g}"] if args.start > 0 else []
    words += ["--stop", f"{args.stop:g}"] if args.stop < float("inf") else []
    return shlex.join(words)
