"""`canid export LOG`: samples and estimates as tables for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from canid.cli import options, reading
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info
from canid.cli.output.outputs import Output


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.vehicle(parser)
    parser.add_argument("--to", choices=("csv", "parquet"), default="csv", help="file format; default: csv")
    parser.add_argument(
        "-o",
        "--output",
        metavar="NAME",
        help="write NAME.samples.csv and NAME.estimates.csv; default: the log's name without its suffix",
    )
    parser.add_argument(
        "--dt",
        type=options.above_zero,
        default=0.1,
        metavar="S",
        help="sampling interval in seconds; default: 0.1",
    )
    options.part(parser)
    options.force(parser)
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Export."""
    from canid import export
    from canid.views import json_values

    name = args.output or str(Path(args.log).with_suffix(""))
    kind = output_kinds.PARQUET if args.to == "parquet" else output_kinds.CSV
    tables = {
        what: Output("-o", f"{name}.{what}.{args.to}", kind, replace=args.force)
        for what in ("samples", "estimates")
    }
    json = options.json_output(args)
    # before the log is read: that may take minutes
    outputs.check([json, *tables.values()], options.read_by(args))
    drive = reading.read_drive(args.log, reading.read_vehicle(args.vehicle), args, dt=args.dt)
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
            info(f"{path}: {rows:,} rows, {len(table)} columns")
        if sink is not None:
            sink.write(json_values.line(written) + "\n")
    return reading.report_health(drive.health)
