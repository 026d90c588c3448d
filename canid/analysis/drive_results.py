"""`identify`, `diagnose` and `compare` as functions of a log, a drive or a trace: what the command line calls one by one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Real
from pathlib import Path
from typing import Any

from canid.analysis.comparison import comparison
from canid.analysis.comparison.comparison import Comparison
from canid.analysis.comparison.drive import Side
from canid.analysis.comparison.result_estimates import of_identified, of_report
from canid.analysis.drive import drive_parameters
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_reader import Drive, as_vehicle, read_drive
from canid.analysis.tables import column_map, kinds
from canid.analysis.tables.table import open_table
from canid.models.diagnosis import diagnose as diagnosis
from canid.signals.vehicle import Vehicle
from canid.values.findings import Provenance, Report
from canid.values.text.numbers import role_unit
from canid.values.types import Trace

Log = Trace | Drive | str | Path


def identify(
    drive: Log,
    vehicle: Vehicle | str | Path | None = None,
    *,
    start: float = -math.inf,
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
        start: s since the first frame, of a log: leave out what is earlier; -inf: nothing.
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
        >>> result = canid.identify("replay_logs/following_urban.blf", "generic", select_orders=False, sliding=False)
        >>> print(result.channels["range_rate"].K)
        5.6 [5.0, 6.2]
    """
    trace, log, car = _read(drive, vehicle, start, stop)
    settings = {**(car.estimators if car else {}), **settings}
    identified = drive_parameters.identify(trace, select_orders=select_orders, sliding=sliding, **settings)
    return identified._replace(log=log, vehicle=car.name if car else "")


def diagnose(
    drive: Log,
    vehicle: Vehicle | str | Path | None = None,
    *,
    start: float = -math.inf,
    stop: float = math.inf,
    **settings: Any,
) -> Report:
    """Diagnose a drive: what its simulation gets wrong, why, and by how much a better model is better.

    Args:
        drive: as in `identify`.
        vehicle: as in `identify`.
        start: s since the first frame, of a log: leave out what is earlier; -inf: nothing.
        stop: s, of a log: leave out what is later.
        **settings: of `canid.models.diagnosis.diagnose.diagnose`: `rivals=True` calibrates published models as well,
            `minimum` s of driving must be there, `catalogue` are the effects that may be named.

    Returns:
        a `Report`. A drive that decides nothing gets a verdict as well, never an exception.

    Raises:
        ConfigError, LogError, TypeError: as in `identify`.
    """
    trace, log, car = _read(drive, vehicle, start, stop)
    given = {"estimators": car.estimators if car else None, **settings}
    report = diagnosis.diagnose(trace, **given)
    return report._replace(provenance=Provenance(log=log, vehicle=car.name if car else ""))


Compared = Identified | Report | Log


def compare(
    a: Compared | Iterable[Compared],
    b: Compared | Iterable[Compared],
    vehicle: Vehicle | str | Path | None = None,
) -> Comparison:
    """Compare two drivers by what `identify` or `diagnose` found on their drives.

    Args:
        a: a result, or several of one driver; or what `identify` takes, such as the path of a log, which is identified.
        b: the same of the other driver.
        vehicle: of logs; as in `identify`.

    Returns:
        a `Comparison`: every verdict holds for all parameters together.

    Raises:
        ValueError: a side without a drive.
        ConfigError, LogError, TypeError: as in `identify`.
    """
    return comparison.compare(_side("A", a, vehicle), _side("B", b, vehicle))


def _side(label: str, compared: Compared | Iterable[Compared], vehicle: Vehicle | str | Path | None) -> Side:
    one_drive = isinstance(compared, Identified | Report | Trace | Drive | str | Path)
    if not one_drive and not isinstance(compared, Iterable):
        raise TypeError(f"compare: {compared!r:.60} is no result of identify or diagnose, and no log")
    given: list[Any] = [compared] if one_drive else list(compared)  # type: ignore[arg-type]
    if not given:
        raise ValueError(f"compare: side {label} has no drive")
    results = [
        identify(drive, vehicle, select_orders=False, sliding=False)
        if isinstance(drive, Trace | Drive | str | Path)
        else drive
        for drive in given
    ]
    drives = []
    for k, result in enumerate(results, 1):
        if isinstance(result, Identified):
            unit = role_unit(result.drive_summary.output)
            drives.append(of_identified(result, result.log or f"{label}{k}", result.vehicle, unit))
        elif isinstance(result, Report):
            made_from = result.provenance
            drives.append(
                of_report(result, made_from.log or f"{label}{k}", made_from.vehicle, role_unit(result.output))
            )
        else:
            raise TypeError(f"compare: {result!r:.60} is no result of identify or diagnose, and no log")
    return Side(label, tuple(drives))


def _read(
    drive: Log, vehicle: Vehicle | str | Path | None, start: float, stop: float
) -> tuple[Trace, str, Vehicle | None]:
    """The trace, the log's name, and the vehicle where one was given."""
    bounds: tuple[tuple[str, object], ...] = (("start", start), ("stop", stop))
    for name, value in bounds:
        if not isinstance(value, Real):
            raise TypeError(f"{name}={value!r:.60} is no number; give s since the first frame, such as 10.0")
    if vehicle is not None and not isinstance(vehicle, Vehicle | str | Path):
        raise TypeError(
            f"vehicle={vehicle!r:.60} is no vehicle file; give its path, its name, or read_vehicle(...)"
        )
    if not isinstance(drive, Trace | Drive | str | Path):
        raise TypeError(
            f"{drive!r:.60} is no drive; give the path of a log or table, or what read_trace, read_drive, from_frame or "
            "from_arrays returned"
        )
    car = None if vehicle is None else as_vehicle(vehicle)
    if isinstance(drive, Trace):
        return drive, "", car
    if isinstance(drive, Drive):
        return drive.trace, "", car
    if kinds.is_table(drive):
        return _of_table(drive, car, start, stop)
    if car is None:
        raise TypeError(f'{drive}: a log needs its vehicle, such as vehicle="generic" or vehicle="mine.toml"')
    return read_drive(drive, car, estimating=False, start=start, stop=stop).trace, str(drive), car


def _of_table(
    drive: str | Path, car: Vehicle | None, start: float, stop: float
) -> tuple[Trace, str, Vehicle | None]:
    """A table of named columns brings its own vehicle; one that is given states the driver."""
    by = None if car is None else column_map.of_vehicle(car)
    table = open_table(drive, by)
    read = read_drive(drive, table.vehicle, estimating=False, start=start, stop=stop, log=table.log)
    return read.trace, str(drive), table.vehicle
