"""The drives of a fleet folder as a table of estimates for the population, and which drives are left out, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.errors import ConfigError
from canid.fleet.columns import natural
from canid.fleet.database import opened, rows
from canid.fleet_summary import Excluded, Kind
from canid.identification.confidence import NORMAL_QUANTILE
from canid.population import drive_table as tables
from canid.population.drive_table import DriveTable
from canid.types import Array, Identifiable

# parameters that are pooled together. The lag and the dead time apart are known from few drives only; their sum stands for
# them here, and they have a table of their own
MAIN = (
    "headway_error.K",
    "range_rate.K",
    "headway_error.log_tau_plus_dead_time",
    "range_rate.log_tau_plus_dead_time",
    "log_noise_sd",
    "wanted_headway",
)
TIMES = (
    "headway_error.log_tau",
    "headway_error.dead_time",
    "range_rate.log_tau",
    "range_rate.dead_time",
)
# of a driver who keeps the lane
LANE = ("lateral_offset.K", "lateral_offset.log_tau_plus_dead_time", "log_noise_sd")
# outputs whose gains mean the same in every car
_OF_ANY_CAR = ("accel", "accel_command")
# statuses in which a parameter is known: a gain in each of them, a delay where the box does not decide its posterior
_KNOWN = {
    "K": tuple(status.value for status in Identifiable),
    "tau_plus_dead_time": (Identifiable.OK.value, Identifiable.SUM_ONLY.value),
    "tau": (Identifiable.OK.value,),
    "dead_time": (Identifiable.OK.value,),
}
# in the JSON of canid identify, where a declared prior has a share in an estimate
WITH_PRIOR = r'"prior_weight": *[0-9]'
# s; of less no estimator gives anything (`canid.estimators`): with more it is the excitation that lacks
MIN_USABLE_S = 60.0


class Selection(NamedTuple):
    """The drives of one kind of output."""

    kind: Kind
    table: DriveTable
    usable: Array  # (n,) s
    excluded: tuple[Excluded, ...]


def kinds(db: Any) -> tuple[Kind, ...]:
    """Kinds of output in a folder, those with most drives first.

    Gains of different outputs or units are never pooled. Those of a pedal or a steering wheel depend on the car: each car
    is a kind of its own.

    Args:
        db: from `database.opened`.
    """
    found: dict[Kind, int] = {}
    for row in rows(
        db,
        "SELECT output, unit, car, count(*) AS n FROM drives "
        "WHERE key IS NOT NULL AND output IS NOT NULL AND output <> '' GROUP BY ALL",
    ):
        kind = _kind(row)
        found[kind] = found.get(kind, 0) + int(row["n"])
    return tuple(sorted(found, key=lambda kind: (-found[kind], kind)))


def names_of(db: Any, kind: Kind) -> tuple[tuple[str, ...], ...]:
    """Parameters of a kind of output, in groups that are pooled apart.

    Args:
        db: from `database.opened`.
        kind: of output.
    """
    (row,) = rows(
        db,
        "SELECT count(lateral_offset_status) AS lane, count(range_rate_status) AS following FROM drives "
        "WHERE output = ? AND key IS NOT NULL",
        [kind.output],
    )
    if row["lane"] > row["following"]:
        return (LANE,)
    # the driver of a pedal has no headway at which the acceleration is 0
    main = MAIN if kind.output in _OF_ANY_CAR else tuple(name for name in MAIN if name != "wanted_headway")
    return main, TIMES


def without_output(db: Any) -> list[Excluded]:
    """Analysed drives of no kind of output: nothing is known of their driver."""
    found = rows(
        db,
        "SELECT log, driver, usable, array_to_string(signal_findings, ', ') AS faults FROM drives "
        "WHERE key IS NOT NULL AND coalesce(output, '') = '' ORDER BY log",
    )
    return [
        Excluded(row["log"], row["driver"] or "", _unknown(row["faults"] or "", row["usable"] or 0.0))
        for row in found
    ]


def selection(db: Any, kind: Kind, names: Sequence[str] = MAIN) -> Selection:
    """The table of one kind of output.

    Args:
        db: from `database.opened`.
        kind: of output.
        names: parameters, see `columns.POPULATION_PARAMETERS`.

    Returns:
        Drives with at least one known parameter. K is known wherever it has an interval, also one that its status does not
        let be quoted: small gains would be left out else, and a population of the others is too large and too narrow. Log
        tau + dead time is known where the status is ok or sum_only, log tau and dead time where it is ok. Covariances
        between parameters are those of the joint posterior where a drive has one, else 0; log noise sd and wanted headway
        are from their intervals.
    """
    of = _Columns(db, kind)
    n = len(of.text("log"))
    estimate = np.full((n, len(names)), np.nan)
    covariance = np.full((n, len(names), len(names)), np.nan)
    for j, name in enumerate(names):
        estimate[:, j], covariance[:, j, j] = _marginal(of, name)
    known = np.isfinite(estimate)
    for j, first in enumerate(names):
        for k, second in enumerate(names[:j]):
            both = known[:, j] & known[:, k]
            shared = np.where(both, np.nan_to_num(_joint_covariance(of, first, second)), np.nan)
            covariance[:, j, k] = covariance[:, k, j] = shared
    excluded, keep = _excluded(of, known)
    places = np.flatnonzero(keep)
    table = tables.drive_table(
        tuple(names),
        estimate[places],
        covariance[places],
        of.chosen("driver", places),
        drives=of.chosen("log", places),
        start=of.number("start_utc")[places],
        group=of.chosen("group_name", places),
        car=of.chosen("car", places),
    )
    return Selection(kind, table, of.number("usable")[places], excluded)


def drive_table(
    folder: str | Path,
    output: str | None = None,
    unit: str | None = None,
    car: str | None = None,
    names: Sequence[str] = MAIN,
) -> DriveTable:
    """The table of a folder; with several kinds of output the one that is asked for.

    Args:
        folder: of `canid fleet -o`.
        output: role of the driver's output, such as "accel"; None: the folder's only one.
        unit: of the output; None: the only one.
        car: of pedals; None: the only one.
        names: parameters.

    Raises:
        ConfigError: it is no folder of canid fleet, or none or several kinds of output fit.
    """
    with opened(folder) as db:
        there = kinds(db)
        fitting = [
            kind
            for kind in there
            if output in (None, kind.output) and unit in (None, kind.unit) and car in (None, kind.car)
        ]
        if len(fitting) != 1:
            found = "; ".join(kind.text() for kind in there) or "nothing"
            asked = ", ".join(x for x in (output, unit, car) if x is not None)
            wrong = f"no drive of {asked}" if not fitting else "several kinds of output"
            raise ConfigError(f"{folder}: {wrong}: choose by output, unit and car among {found}")
        return selection(db, fitting[0], names).table


class _Columns:
    """Columns of the analysed drives of one kind, in the order of their logs, read as they are asked for."""

    def __init__(self, db: Any, kind: Kind) -> None:
        self._db = db
        self._where = (
            "FROM drives WHERE key IS NOT NULL AND output = ? AND coalesce(unit, '') = ? "
            + ("" if kind.output in _OF_ANY_CAR else "AND coalesce(car, '') = ? ")
            + "ORDER BY coalesce(driver, ''), start_utc NULLS LAST, log"
        )
        self._values = [kind.output, kind.unit, *([] if kind.output in _OF_ANY_CAR else [kind.car])]
        self._read: dict[str, Any] = {}

    def number(self, sql: str) -> Array:
        """Numbers, (n,); NaN: not known."""
        column = self._column(f"CAST({sql} AS DOUBLE)")
        return np.ma.filled(np.ma.asarray(column, dtype=np.float64), np.nan)

    def text(self, sql: str) -> tuple[str, ...]:
        """Texts; "": not known."""
        return tuple(map(str, self._column(f"coalesce(CAST({sql} AS VARCHAR), '')")))

    def chosen(self, sql: str, places: npt.NDArray[np.intp]) -> tuple[str, ...]:
        """Texts of some rows."""
        column = self.text(sql)
        return tuple(column[k] for k in places)

    def _column(self, sql: str) -> Any:
        if sql not in self._read:
            self._read[sql] = self._db.execute(f"SELECT {sql} AS x {self._where}", self._values).fetchnumpy()[
                "x"
            ]
        return self._read[sql]


def _marginal(of: _Columns, name: str) -> tuple[Array, Array]:
    """Estimate and its variance, (n,) each; NaN where it is not known."""
    column, log = natural(name)
    value, low, high = (of.number(f'"{column}{end}"') for end in ("", "_low", "_high"))
    with np.errstate(invalid="ignore", divide="ignore"):
        if log:
            value, low, high = np.log(value), np.log(low), np.log(high)
        mean, variance = value, ((high - low) / (2.0 * NORMAL_QUANTILE)) ** 2
    channel, _, parameter = name.rpartition(".")
    usable = np.isfinite(mean) & np.isfinite(variance) & (variance > 0.0)
    if channel:
        joint, joint_variance = of.number(_element(name)), _joint_covariance(of, name, name)
        there = np.isfinite(joint) & (joint_variance > 0.0)
        if parameter == "K":
            usable |= there
        statuses = _KNOWN[parameter.removeprefix("log_")]
        usable &= np.isin(np.array(of.text(f"{channel}_status"), dtype=object), statuses)
        there &= usable
        mean, variance = np.where(there, joint, mean), np.where(there, joint_variance, variance)
    return np.where(usable, mean, np.nan), np.where(usable, variance, np.nan)


def _element(name: str) -> str:
    return f"estimate[list_position(names, '{name}')]"


def _joint_covariance(of: _Columns, first: str, second: str) -> Array:
    """Of the joint posterior; NaN where a drive has none, or not of these."""
    if "." not in first or "." not in second:
        return np.full(len(of.text("log")), np.nan)
    at = "(list_position(names, '{}') - 1)"
    return of.number(f"covariance[{at.format(first)} * len(names) + {at.format(second)} + 1]")


def _excluded(
    of: _Columns, known: npt.NDArray[np.bool_]
) -> tuple[tuple[Excluded, ...], npt.NDArray[np.bool_]]:
    logs, drivers = of.text("log"), of.text("driver")
    faults = of.text("array_to_string(signal_findings, ', ')")
    steps, usable = of.number("gain_steps"), of.number("usable")
    leaning = of.text(f"regexp_matches(identify_json, '{WITH_PRIOR}')")
    out, keep = [], np.ones(len(logs), dtype=np.bool_)
    for k, log in enumerate(logs):
        why = ""
        if steps[k] > 0:
            why = "the gains changed during the drive: it has no one estimate"
        elif leaning[k] == "true":
            why = "identified with a declared [fopdt.prior]: the population would count that one again"
        elif not known[k].any():
            why = _unknown(faults[k], usable[k])
        elif not drivers[k]:
            why = "no driver is stated"
        if why:
            keep[k] = False
            out.append(Excluded(log, drivers[k], why))
    return tuple(out), keep


def _unknown(faults: str, usable: float) -> str:
    """Why a drive knows nothing, in few classes, so that the reasons can be counted."""
    if faults:
        return f"signals are wrong: {faults}"
    if not usable >= MIN_USABLE_S:
        return "no parameter is known: less than a minute of usable driving"
    return "no parameter is known: the driving excites too little"


def _kind(row: Mapping[str, Any]) -> Kind:
    output = str(row["output"])
    return Kind(output, str(row["unit"] or ""), "" if output in _OF_ANY_CAR else str(row["car"] or ""))
