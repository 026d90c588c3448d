"""`canid export LOG`: signals and estimates for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from canid.cli import options, output_kinds, outputs, progress
from canid.cli.outputs import Output
from canid.cli.talk import talk
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
    kind = output_kinds.PARQUET if args.to == "parquet" else output_kinds.CSV
    tables = {
        what: Output("-o", f"{name}.{what}.{args.to}", kind, replace=args.force)
        for what in ("samples", "estimates")
    }
    json = options.json_output(args)
    # before the log is read: that may take minutes
    outputs.check([json, *tables.values()], options.read_by(args))
    log = open_log(args.log)
    bar = progress.Progress(f"reading {args.log}")
    try:
        drive = logs.read_drive(
            args.log, args.vehicle, dt=args.dt, start=args.start, stop=args.stop, log=log, progress=bar.to
        )
    finally:
        bar.close()
    columns = {
        "samples": export.samples_table(drive.trace),
        "estimates": export.estimates_table(drive.estimates),
    }
    written = []
    with outputs.opened(json) as sink:
        for what, table in columns.items():
            with outputs.opened_file(tables[what]) as file:
                file.write(export.parquet(table) if args.to == "parquet" else export.csv_text(table))
            path, rows = tables[what].path, len(next(iter(table.values()), ()))
            written.append({"path": path, "rows": rows, "columns": list(table)})
            talk(f"{path}: {rows:,} rows, {len(table)} columns")
        if sink is not None:
            sink.write(as_json.line(written) + "\n")
    found = drive.health
    for line in summary.health(found.damage, found.back_in_time, found.counters, found.missing):
        talk(line)
    return DAMAGED if found.damage or found.back_in_time else DONE
