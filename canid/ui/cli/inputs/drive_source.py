"""What a verb reads: a CAN log with its vehicle file, or a table of named columns, which brings its own."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from canid.ui.cli.inputs import reading
from canid.ui.terminal.messages import info
from canid.ui.terminal.progress import Progress
from canid.values.errors import ConfigError

if TYPE_CHECKING:
    from canid.analysis.drive.drive_reader import Drive
    from canid.analysis.tables.column_map import ColumnMap
    from canid.analysis.tables.table import Selection
    from canid.io.logs import Log
    from canid.signals.vehicle import Vehicle

# a vehicle file has no such section
_COLUMNS = re.compile(rb"^\s*\[\s*columns\b|^\s*columns\s*[.=]", re.MULTILINE)
# bytes in which it is looked for
_BEGIN_BYTES = 256_000


class Car(NamedTuple):
    """The vehicle file or the column map of the command line, and the selection of rows."""

    verb: str
    vehicle: Vehicle | None
    columns: ColumnMap | None
    selection: Selection

    @property
    def given(self) -> str:
        """Options that hold for tables alone, as far as they are given."""
        chosen = self.selection
        options = ("--columns" * bool(self.columns), "--where" * bool(chosen.where))
        return ", ".join(filter(None, (*options, "--vehicle-id" * (chosen.vehicle_id is not None))))


def arguments(parser: argparse.ArgumentParser) -> None:
    """--columns, --where, --vehicle-id."""
    group = parser.add_argument_group(
        "tables",
        "LOG may be .csv, .tsv, .parquet or .vbo with named columns: time, pedal, speed [km/h], gap, range_rate, ...",
    )
    group.add_argument(
        "--columns",
        metavar="MAP",
        help="which column is which: a TOML file with [columns], or one of citysim, exid, follownet, highd, lyft, ngsim, "
        "openacc, openpilot, sumo, ultra_av, waymo",
    )
    group.add_argument(
        "--where",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="only rows whose column NAME is VALUE; may be repeated",
    )
    group.add_argument(
        "--vehicle-id",
        metavar="ID",
        help="the vehicle, in a table of several; ID#2: the second one that has this id; all: one estimate over all, "
        "each an episode",
    )


def car(args: argparse.Namespace, verb: str, vehicle: str | None = None) -> Car:
    """Read what --vehicle and --columns name, and report its warnings.

    Args:
        args: of the verb.
        verb: for messages.
        vehicle: instead of --vehicle.

    Raises:
        ConfigError: a file is wrong, or both name columns.
    """
    from canid.analysis.tables.table import Selection

    named = vehicle if vehicle is not None else args.vehicle
    columns = getattr(args, "columns", None)
    chosen = Selection(tuple(getattr(args, "where", ())), getattr(args, "vehicle_id", None))
    if named is not None and _is_map(named):
        if columns is not None:
            raise ConfigError(f"{verb}: --vehicle {named} names columns; leave out --columns")
        columns, named = named, None
    if columns is None:
        return Car(verb, reading.read_vehicle(named) if named is not None else None, None, chosen)
    if named is not None:
        raise ConfigError(f"{verb}: --columns {columns} brings its own driver; leave out --vehicle {named}")
    from canid.analysis.tables.column_map import read_map

    return Car(verb, None, read_map(columns), chosen)


def _is_map(name: str) -> bool:
    from canid.io.logs.input_file import is_regular

    path = Path(name)
    try:
        if not is_regular(path):  # a pipe is never waited for
            return False
        with path.open("rb") as file:
            return bool(_COLUMNS.search(file.read(_BEGIN_BYTES)))
    except (OSError, ValueError):
        return False


def is_table(path: str) -> bool:
    """Whether a file is a table; see `analysis.tables.kinds`."""
    from canid.analysis.tables import kinds

    return kinds.is_table(path)


def opened(path: str, car: Car) -> tuple[Log, Vehicle]:
    """Open a log or a table.

    Raises:
        ConfigError: no vehicle was named for a log; a column of a table is missing.
        LogError: it cannot be read.
    """
    if not is_table(path):
        return _log(path, car)
    from canid.analysis.tables import column_map
    from canid.analysis.tables.table import open_table

    by, vehicle = car.columns, car.vehicle
    if by is None and vehicle is not None:
        by = column_map.of_vehicle(vehicle)
    with Progress(f"reading {path}") as bar:
        table = open_table(path, by, car.selection, bar.to)
    info(f"{path}: {table.columns}")
    for note in table.notes:
        info(note)
    return table.log, table.vehicle


def _log(path: str, car: Car) -> tuple[Log, Vehicle]:
    from canid.io.logs import open_log

    log = open_log(path)
    if car.given:
        raise ConfigError(f"{car.verb}: {path} is a log of CAN frames: {car.given} is for tables")
    if car.vehicle is None:
        raise ConfigError(
            f"{car.verb}: {path} is a log of CAN frames: --vehicle V.toml is missing (`canid init FILE.dbc` proposes one)"
        )
    return log, reading.on_buses(car.vehicle, log)


def read_drive(path: str, car: Car, args: argparse.Namespace, **settings: Any) -> tuple[Drive, Vehicle]:
    """Read the part of a log or a table from --start to --stop, with a progress bar.

    Args:
        path: of the log or table.
        car: from `car`.
        args: with `start` and `stop`, s.
        settings: of `drive_reader.read_drive`.

    Raises:
        ConfigError: no vehicle was named for a log; a column of a table is missing.
        LogError: nothing can be read.
    """
    from canid.analysis.drive import drive_reader

    log, vehicle = opened(path, car)
    with Progress(f"reading {path}") as bar:
        drive = drive_reader.read_drive(
            path, vehicle, start=args.start, stop=args.stop, log=log, progress=bar.to, **settings
        )
    return drive, vehicle
