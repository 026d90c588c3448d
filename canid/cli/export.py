"""`canid export LOG`: signals and estimates for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from canid.cli import options, progress
from canid.errors import DAMAGED, DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.vehicle(parser)
    parser.add_argument("--to", choices=("csv", "parquet"), default="csv", help="format; default: csv")
    parser.add_argument(
        "-o",
        "--output",
        metavar="NAME",
        help="NAME.samples.csv and NAME.estimates.csv; default: the log's name",
    )
    parser.add_argument(
        "--dt", type=options.above_zero, default=0.1, metavar="S", help="step of the grid; default: 0.1"
    )
    options.part(parser)
    options.force(parser)
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Export."""
    from canid import export, logs
    from canid.frames import open_log
    from canid.views import as_json, summary

    name = args.output or str(Path(args.log).with_suffix(""))
    paths = {what: f"{name}.{what}.{args.to}" for what in ("samples", "estimates")}
    for path in paths.values():
        # before the log is read: that may take minutes
        options.refuse_to_overwrite(path, force=args.force)
    log = open_log(args.log)
    bar = progress.Progress(f"reading {args.log}")
    try:
        drive = logs.read_drive(
            args.log, args.vehicle, dt=args.dt, start=args.start, stop=args.stop, log=log, progress=bar.to
        )
    finally:
        bar.close()
    tables = {
        "samples": export.samples_table(drive.trace),
        "estimates": export.estimates_table(drive.estimates),
    }
    written = []
    with options.sink(args.json) as sink:
        for what, table in tables.items():
            export.write_table(paths[what], table, overwrite=args.force)
            rows = len(next(iter(table.values()), ()))
            written.append({"path": paths[what], "rows": rows, "columns": list(table)})
            options.talk(f"{paths[what]}: {rows:,} rows, {len(table)} columns")
        if sink is not None:
            sink.write(as_json.line(written) + "\n")
    found = drive.health
    for line in summary.health(found.damage, found.back_in_time, found.counters, found.missing):
        options.talk(line)
    return DAMAGED if found.damage or found.back_in_time else DONE
