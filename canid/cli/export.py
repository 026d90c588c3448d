"""`canid export LOG`: signals and estimates for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from canid.cli import options, show
from canid.errors import DAMAGED, DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG")
    options.vehicle(parser)
    parser.add_argument("--to", choices=("csv", "parquet"), default="csv", help="default: csv")
    parser.add_argument(
        "-o",
        "--output",
        metavar="NAME",
        help="NAME.samples.csv and NAME.estimates.csv; default: the log's name",
    )
    parser.add_argument("--dt", type=options.seconds, default=0.1, metavar="S", help="step of the grid")
    options.part(parser)
    options.force(parser)


def run(args: argparse.Namespace) -> int:
    """Export."""
    from canid import export, logs
    from canid.frames import open_log
    from canid.views import summary

    log = open_log(args.log)
    bar = show.Progress(f"reading {args.log}")
    try:
        drive = logs.read_drive(
            args.log, args.vehicle, dt=args.dt, start=args.start, stop=args.stop, log=log, progress=bar.to
        )
    finally:
        bar.close()
    name = args.output or str(Path(args.log).with_suffix(""))
    tables = {
        "samples": export.samples_table(drive.trace),
        "estimates": export.estimates_table(drive.estimates),
    }
    for what, table in tables.items():
        path = f"{name}.{what}.{args.to}"
        export.write_table(path, table, overwrite=args.force)
        rows = len(next(iter(table.values()), ()))
        options.talk(f"{path}: {rows:,} rows, {len(table)} columns")
    found = drive.health
    for line in summary.health(found.damage, found.back_in_time, found.counters, found.missing):
        options.talk(line)
    return DAMAGED if found.damage or found.back_in_time else DONE
