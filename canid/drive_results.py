"""`identify`, `diagnose` and `compare` as functions of a log, a drive or a trace: what the command line calls one by one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from canid import drive_parameters
from canid.comparison import comparison, drive_json
from canid.comparison.comparison import Comparison
from canid.comparison.drive import Side
from canid.diagnosis import diagnose as diagnosis
from canid.drive_parameters import Identified
from canid.drive_reader import Drive, as_vehicle, read_drive
from canid.findings import Provenance, Report
from canid.tables import column_map, kinds
from canid.tables.table import open_table
from canid.types import Trace
from canid.vehicle import Vehicle
from canid.views import diagnosis_json, identification_json

Log = Trace | Drive | str | Path


def identify(
    drive: Log,
    vehicle: Vehicle | str | Path | None = None,
    *,
    start: float = 0.0,
    stop: float = math.inf,
    select_orders: bool = True,
    sliding: bool = True,
    **settings: Any,
) -> Identified:
    """Identify the driver of a whole drive: K, τ and θ of every input, with 95 % intervals and statuses.

    Args:
        drive: a log, a table of named columns (CSV, Parquet), or what `read_trace`, `read_drive` or `from_arrays` returned.
        vehicle: of a log: a vehicle file, its name, or what `read_vehicle` returned. Its settings of the estimators
            hold for a trace as well, where it is given.
        start: s, of a log: leave out what is earlier.
        stop: s, of a log: leave out what is later.
        select_orders: compare other orders of ARMAX as well.
        sliding: estimate in sliding windows as well, which takes two thirds of the time.
        **settings: by estimator: `armax=ArmaxSettings(...)`, `fopdt=FopdtSettings(...)`.

    Returns:
        an `Identified`; what is not identifiable from the drive is NaN, never an exception.

    Raises:
        ConfigError: the vehicle file is wrong, or nothing in the log is mapped by it.
        LogError: the log cannot be read.
        TypeError: a log without its vehicle, or settings of an estimator that does not exist.

    Example:
        >>> import canid
        >>> found = canid.identify("replay_logs/following_urban.blf", "generic", select_orders=False, sliding=False)
        >>> print(found.channels["range_rate"].K)
        5.6 [5.0, 6.2]
    """
    trace, log, car = _read(drive, vehicle, start, stop)
    settings = {**(car.estimators if car else {}), **settings}
    found = drive_parameters.identify(trace, select_orders=select_orders, sliding=sliding, **settings)
    return found._replace(log=log, vehicle=car.name if car else "")


def diagnose(
    drive: Log,
    vehicle: Vehicle | str | Path | None = None,
    *,
    start: float = 0.0,
    stop: float = math.inf,
    **settings: Any,
) -> Report:
    """Diagnose a drive: what its simulation gets wrong, why, and by how much a better model is better.

    Args:
        drive: as in `identify`.
        vehicle: as in `identify`.
        start: s, of a log: leave out what is earlier.
        stop: s, of a log: leave out what is later.
        **settings: of `canid.diagnosis.diagnose.diagnose`: `rivals=True` calibrates published models as well,
            `minimum` s of driving must be there, `catalogue` are the effects that may be named.

    Returns:
        a `Report`. A drive that decides nothing gets a verdict as well, never an exception.

    Raises:
        ConfigError, LogError, TypeError: as in `identify`.
    """
    trace, log, car = _read(drive, vehicle, start, stop)
    report = diagnosis.diagnose(trace, **settings)
    return report._replace(provenance=Provenance(log=log, vehicle=car.name if car else ""))


Compared = Identified | Report


def compare(a: Compared | Iterable[Compared], b: Compared | Iterable[Compared]) -> Comparison:
    """Compare two drivers by what `identify` or `diagnose` found on their drives.

    Args:
        a: a result, or several of one driver.
        b: the same of the other driver.

    Returns:
        a `Comparison`: every verdict holds for all parameters together.

    Raises:
        ValueError: a side without a drive.
    """
    return comparison.compare(_side("A", a), _side("B", b))


def _side(label: str, of: Compared | Iterable[Compared]) -> Side:
    results = [of] if isinstance(of, Identified | Report) else list(of)
    if not results:
        raise ValueError(f"compare: side {label} has no drive")
    drives = []
    for k, one in enumerate(results, 1):
        if isinstance(one, Identified):
            name, made = one.log or f"{label}{k}", identification_json.to_json(one, one.log, one.vehicle)
        elif isinstance(one, Report):
            name = one.provenance.log or f"{label}{k}"
            made = diagnosis_json.to_json(one, name, one.provenance.vehicle)
        else:
            raise TypeError(f"compare: {type(one).__name__} is no result of identify or diagnose")
        drives.append(drive_json.read(made, name))
    return Side(label, tuple(drives))


def _read(
    drive: Log, vehicle: Vehicle | str | Path | None, start: float, stop: float
) -> tuple[Trace, str, Vehicle | None]:
    """The trace, the log's name, and the vehicle where one was given."""
    car = None if vehicle is None else as_vehicle(vehicle)
    if isinstance(drive, Trace):
        return drive, "", car
    if isinstance(drive, Drive):
        return drive.trace, "", car
    if kinds.is_table(drive):
        return _of_table(drive, car, start, stop)
    if car is None:
        raise TypeError(f"{drive}: a log needs its vehicle: identify(log, vehicle), diagnose(log, vehicle)")
    return read_drive(drive, car, estimating=False, start=start, stop=stop).trace, str(drive), car


def _of_table(
    drive: str | Path, car: Vehicle | None, start: float, stop: float
) -> tuple[Trace, str, Vehicle | None]:
    """A table of named columns brings its own vehicle; one that is given states the driver."""
    by = None if car is None else column_map.of_vehicle(car)
    table = open_table(drive, by)
    read = read_drive(drive, table.vehicle, estimating=False, start=start, stop=stop, log=table.log)
    return read.trace, str(drive), table.vehicle
