"""What `canid export` reads of a log: a drive by its vehicle file, and the signals of DBC files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

from canid import __version__
from canid.analysis.drive.drive_reader import Drive, Health
from canid.analysis.export import drive_tables, raster, signal_tables, vbo_file
from canid.analysis.export.table import Origin, Table
from canid.io.logs import Log, open_log
from canid.signals.signal_checks.output_scale import before_a_drive
from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.database import Dbc
from canid.ui.cli.inputs import reading
from canid.ui.cli.options import options
from canid.ui.terminal.messages import info
from canid.ui.terminal.progress import Progress
from canid.values.bus_names import on_log
from canid.values.errors import ConfigError
from canid.values.types import Damage, Estimate

# signals that a remark names
MOST_NAMED = 5


class Exported(NamedTuple):
    """All that is written."""

    tables: list[Table]
    origin: Origin
    drive: Drive | None  # None: signals alone
    health: Health | None
    damage: Damage | None


def read(args: argparse.Namespace) -> Exported:
    """Read the log.

    Raises:
        ConfigError: the vehicle file or a DBC file is wrong, or nothing of the log is in them.
        LogError: the log cannot be read.
    """
    vehicle = None if args.vehicle is None else reading.read_vehicle(args.vehicle)
    if args.to == "vbo" and vehicle is not None:
        vbo_file.check(set(vehicle.roles), vehicle.name)
    files = [] if args.signals is None else databases(args)
    if files:
        signal_tables.wanted(files, args.signals)  # a pattern that fits nothing is refused at once
    log = open_log(args.log)
    dated = log.start_utc == log.start_utc
    origin = Origin(
        Path(args.log).name,
        log.start_ns if dated else None,
        "" if vehicle is None else vehicle.name,
        f"canid {__version__}",
    )
    tables: list[Table] = []
    drive = None
    if vehicle is not None:
        drive, tables = _drive(args, vehicle)
    if files:
        files = [file._replace(bus=on_log(file.bus, log.buses)) for file in files]
        for file in files:
            log.know(file.messages.values())
        tables += _signals(args, log, files)
    return Exported(
        tables, origin, drive, None if drive is None else drive.health, log.damage if files else None
    )


def databases(args: argparse.Namespace) -> list[Dbc]:
    """The DBC files of --dbc, or of the vehicle file. Raises ConfigError."""
    from canid.signals.dbc_text.parsing import Parser
    from canid.signals.vehicle.database import load
    from canid.signals.vehicle.vehicle_file import read_databases

    if not args.dbc:
        return read_databases(args.vehicle)
    files = []
    with Parser() as parser:
        for path in args.dbc:
            dbc, warnings, _ = load(Path(path), None, parser)
            for warning in warnings:
                info(warning)
            files.append(dbc)
    return files


def _drive(args: argparse.Namespace, vehicle: Vehicle) -> tuple[Drive, list[Table]]:
    live = args.estimates == "all"
    drive = reading.read_drive(args.log, vehicle, args, dt=args.dt, estimating=live)
    if args.to == "vbo":
        return drive, []
    estimates = _estimates(args, vehicle, drive)
    output = vehicle.driver.output
    if args.to == "plotjuggler":
        return drive, [_plot_table(vehicle, drive, estimates)]
    tables = [drive_tables.samples_table(drive.trace, output)]
    if args.estimates == "none":
        return drive, tables
    scale = drive_tables.scale_text(drive.trace)
    if scale == "not confirmed":
        info(before_a_drive(drive.trace.full_scale) or "the pedal's scale is not confirmed")
    if args.to in ("mcap", "mf4"):
        return drive, [*tables, *drive_tables.channel_tables(estimates, output, scale)]
    return drive, [*tables, drive_tables.estimates_table(estimates, scale)]


def _estimates(args: argparse.Namespace, vehicle: Vehicle, drive: Drive) -> list[Estimate]:
    if args.estimates == "all":
        return list(drive.estimates)
    if args.estimates == "none":
        return []
    from canid.analysis.drive.drive_parameters import windows

    with Progress(f"estimating {args.log}"):
        return windows(drive.trace, **vehicle.estimators)


def _plot_table(vehicle: Vehicle, drive: Drive, estimates: list[Estimate]) -> Table:
    from canid.analysis.drive.drive_parameters import identify
    from canid.analysis.drive.drive_series import drive_series

    identified = identify(drive.trace, select_orders=False, sliding=False, **vehicle.estimators)
    series = drive_series(drive.trace, identified, **vehicle.estimators)
    return drive_tables.plot_table(drive.trace, estimates, series, vehicle.driver.output)


def _signals(args: argparse.Namespace, log: Log, files: list[Dbc]) -> list[Table]:
    from canid.analysis.drive.signal_columns import frames_by_message
    from canid.signals.vehicle.transport_protocol import groups_of

    with Progress(f"reading signals of {args.log}") as bar:
        ids = signal_tables.ids_of(files, args.signals)
        groups = groups_of(message for file in files for message in file.messages.values())
        frames = frames_by_message(log, ids=ids, within=options.window(args), progress=bar.to, groups=groups)
    received = signal_tables.received(frames, files, args.signals)
    if not received:
        n = sum(len(columns.t) for columns in frames.values())
        names = ", ".join(file.file for file in files)
        which = f" with a signal that fits {', '.join(args.signals)}" if args.signals else ""
        raise ConfigError(
            f"{args.log}: none of its {n:,} data frames has an id of a message in {names}{which} "
            f"(is it this vehicle's log? `canid check LOG` lists its ids)"
        )
    exact = args.to == "csv" and args.raster is None
    wide = [] if exact else signal_tables.rounded(received)
    if wide:
        where = "on a raster" if args.raster is not None else f"in .{args.to}"
        more = f" and {len(wide) - MOST_NAMED} more" if len(wide) > MOST_NAMED else ""
        info(
            f"{', '.join(wide[:MOST_NAMED])}{more}: of more than 53 bits; {where} they are the doubles next to them, "
            "--to csv without --raster has all digits"
        )
    if args.raster is not None:
        return [raster.raster_table(received, args.raster)]
    return signal_tables.signal_tables(received, exact=exact)
