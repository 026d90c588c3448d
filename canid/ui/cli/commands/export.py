"""`canid export LOG`: samples, estimates and signals of a log, or its driver, as files for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canid.io.files.derived_name import short_stem
from canid.ui.cli.inputs import reading
from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, outputs
from canid.ui.terminal.messages import info
from canid.values import bounded_numbers
from canid.values.errors import DAMAGED, DONE, ConfigError

if TYPE_CHECKING:
    from canid.ui.cli.exporting.export_tables import Exported

DRIVERS = ("sumo", "control", "idtf", "latex", "fmu")
FORMATS = ("csv", "parquet", "mat", "mf4", "mcap", "vbo", "plotjuggler", *DRIVERS)
TABLES = ("csv", "parquet")

# s between two rows: no bus has more frames than one in 0.1 ms of one id; a day
RASTER_S = (1e-4, 86_400.0)
# s between two samples: the checks of the signals need four in a second
SAMPLING_S = (1e-3, 0.25)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.time_zone(parser)
    options.vehicle(parser, required=False)
    parser.add_argument(
        "--dbc",
        metavar="FILE.dbc",
        nargs="+",
        help="DBC files of the signals; default: those of the vehicle file. Without --vehicle: signals alone",
    )
    parser.add_argument(
        "--to",
        choices=FORMATS,
        default="csv",
        help="file format; default: csv. Of the driver: sumo: a vehicle type; control: transfer functions for "
        "python-control; idtf: the same for MATLAB's ident; latex: a table of the parameters; "
        "fmu: an FMU of FMI 3.0 for co-simulation",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="NAME",
        help="write NAME.samples.csv, NAME.mat, ...; default: the log's name without its suffix",
    )
    parser.add_argument(
        "--signals",
        metavar="PATTERN",
        nargs="*",
        help="write the signals of the DBC files as well, each on its own times; with PATTERN those alone whose MESSAGE, "
        "SIGNAL or MESSAGE.SIGNAL fits (* and ? stand for any letters)",
    )
    parser.add_argument(
        "--raster",
        type=bounded_numbers.number("a time in seconds (such as 0.1)", *RASTER_S),
        metavar="S",
        help="write the signals in one table with a row every S seconds; the last value is held for 5 s at most, then the "
        "field is empty",
    )
    parser.add_argument(
        "--estimates",
        choices=("10s", "all", "none"),
        default="10s",
        help="estimates every 10 s as in identify --windows, all of them as live (slow), or none; default: 10s",
    )
    parser.add_argument(
        "--time",
        choices=("log", "utc", "epoch"),
        default="log",
        help="csv, parquet, plotjuggler: times since the log's first frame alone, or absolute times as well, as UTC text or "
        "as seconds since 1970; the other formats always state the start; default: log",
    )
    parser.add_argument(
        "--data",
        choices=("csv", "parquet", "mcap"),
        default="csv",
        help="plotjuggler: format of the file that the layout opens; default: csv",
    )
    parser.add_argument(
        "--dt",
        type=bounded_numbers.number("a time in seconds (such as 0.1)", *SAMPLING_S),
        default=0.1,
        metavar="S",
        help=f"sampling interval of the samples in seconds, {SAMPLING_S[0]:g} to {SAMPLING_S[1]:g}; default: 0.1",
    )
    options.part(parser)
    options.force(parser)
    options.json_file(parser)


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    from canid.ui.cli.exporting.export_files import ExportedFile

    return {"export": ExportedFile}


def run(args: argparse.Namespace) -> int:
    """Export."""
    from canid.ui.cli.exporting import export_files, export_tables
    from canid.values.text import json_values

    _check(args)
    if args.to in DRIVERS:
        from canid.ui.cli.exporting import export_driver

        return export_driver.run(args)
    json = options.json_output(args)
    prefix = _prefix(args)
    # before the log is read: that may take minutes
    known = export_files.known_outputs(args, prefix)
    outputs.check([json, *known.values()], options.read_by(args))
    with complete_files.complete_files() as files, complete_files.opened(json) as sink:
        with export_files.started(args, files, known) as writer:
            exported = export_tables.read(args)
            written = export_files.write(args, prefix, files, known, exported, writer, json)
        files.commit()
        for each in written:
            tables = each.get("tables")
            what = f"{each['rows']:,} rows, {len(each['columns'])} columns"
            if tables:
                what = f"{len(tables)} tables"
            elif not each["columns"]:
                what = "how they are shown"  # a layout for another program
            info(f"{each['path']}: {what}")
        if sink is not None:
            sink.write(json_values.document("export", written) + "\n")
    return _report(args, exported)


def _check(args: argparse.Namespace) -> None:
    """Refuse options that contradict each other. Raises ConfigError."""
    if args.vehicle is None and not args.dbc:
        raise ConfigError(
            "export: needs --vehicle V.toml (samples and estimates) or --dbc FILE.dbc (signals); `canid init` proposes a "
            "vehicle file from DBC files"
        )
    if args.vehicle is None and args.to in ("vbo", "plotjuggler", *DRIVERS):
        raise ConfigError(f"export: --to {args.to} needs --vehicle: it takes samples by role")
    if args.dbc and args.vehicle is not None and args.signals is None:
        raise ConfigError(
            "export: --dbc next to --vehicle needs --signals: the vehicle file names the DBC files of its roles"
        )
    if args.vehicle is None and args.signals is None:
        args.signals = []
    if args.signals is not None and args.to in ("vbo", "plotjuggler", *DRIVERS):
        raise ConfigError(f"export: --to {args.to} has no --signals; use csv, parquet, mat, mf4 or mcap")
    if args.raster is not None and args.signals is None:
        raise ConfigError("export: --raster needs --signals; --dt is the interval of the samples")
    if args.time != "log" and args.to not in (*TABLES, "plotjuggler"):
        raise ConfigError(f"export: --to {args.to} has no --time: it always states the start of the log")


# bytes of the longest ending: of a table's name, its kind, and what a new file is called until it is whole
_ENDING_BYTES = 80


def _prefix(args: argparse.Namespace) -> str:
    """What the names of all files begin with."""
    if args.output is None:
        return str(Path(args.log).with_name(short_stem(Path(args.log).stem, _ENDING_BYTES)))
    name: str = args.output
    ending = f".{args.to}"
    return (
        name[: -len(ending)]
        if args.to not in (*TABLES, "plotjuggler") and name.lower().endswith(ending)
        else name
    )


def _report(args: argparse.Namespace, exported: Exported) -> int:
    """Say what was wrong with the log; returns the exit code."""
    if exported.origin.start_ns is None:
        info(f"{args.log}: states no date; times count from its first frame")
    if exported.health is not None:
        return reading.report_health(exported.health)
    if exported.damage is not None:
        info(exported.damage.says)
        return DAMAGED
    return DONE
