"""The drives of a fleet folder as a table of estimates for the population, and which drives are left out, and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.fleet.answers.labels import label
from canid.analysis.fleet.storage.columns import natural
from canid.analysis.fleet.storage.database import rows
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.population import drive_table as tables
from canid.mathematics.population.drive_table import DriveTable
from canid.values.fleet_summary import Excluded, Kind
from canid.values.text.names import readable
from canid.values.types import Array, Identifiable

# parameters that are pooled together. The lag and the dead time apart are known from few drives only; their sum stands for
# them here, and they have a table of their own
MAIN = (
    "headway_error.K",
    "range_rate.K",
    "headway_error.log_tau_plus_dead_time",
    "range_rate.log_tau_plus_dead_time",
    "log_noise_sd",
    "log_wanted_headway",
)
TIMES = (
    "headway_error.log_tau",
    "headway_error.dead_time",
    "range_rate.log_tau",
    "range_rate.dead_time",
)
_WANTED = "log_wanted_headway"
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
_WITH_PRIOR = f"regexp_matches(identify_json, '{WITH_PRIOR}')"
_FAULTS = "array_to_string(signal_findings, ', ')"
# s; of less no estimator gives anything (`canid.mathematics.estimators`): with more it is the excitation that lacks
MIN_USABLE_S = 60.0


class Selection(NamedTuple):
    """The drives of one kind of output."""

    kind: Kind
    table: DriveTable
    usable: Array  # (n,) s
    excluded: tuple[Excluded, ...]
    withheld: tuple[str, ...] = ()  # gains of drives that `identify` withholds, and why, in sentences


def kinds(db: Any) -> tuple[Kind, ...]:
    """Kinds of output in a folder, those with most drives first.

    Gains of different outputs or units are never pooled. Those of a pedal or a steering wheel depend on the car: each car
    is a kind of its own.

    Args:
        db: from `database.opened`.
    """
    counted: dict[Kind, int] = {}
    for row in rows(
        db,
        "SELECT output, unit, car, count(*) AS n FROM drives "
        "WHERE key IS NOT NULL AND output IS NOT NULL AND output <> '' GROUP BY ALL",
    ):
        kind = _kind(row)
        counted[kind] = counted.get(kind, 0) + int(row["n"])
    return tuple(sorted(counted, key=lambda kind: (-counted[kind], kind)))


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
    main = MAIN if kind.output in _OF_ANY_CAR else tuple(name for name in MAIN if name != _WANTED)
    return main, TIMES


def without_output(db: Any) -> list[Excluded]:
    """Analysed drives of no kind of output: nothing is known of their driver."""
    read = rows(
        db,
        "SELECT log, driver, usable, array_to_string(signal_findings, ', ') AS faults FROM drives "
        "WHERE key IS NOT NULL AND coalesce(output, '') = '' ORDER BY log",
    )
    return [
        Excluded(row["log"], row["driver"] or "", _unknown(row["faults"] or "", row["usable"] or 0.0))
        for row in read
    ]


def selection(db: Any, kind: Kind, names: Sequence[str] = MAIN) -> Selection:
    """The table of one kind of output.

    Args:
        db: from `database.opened`.
        kind: of output.
        names: parameters, see `columns.POPULATION_PARAMETERS`.

    Returns:
        Drives with at least one known parameter. K is known wherever it has an interval, also one that its status does not
        let be quoted: small gains would be left out else, and a population of the others is too large and too narrow. One
        that `identify` withholds for another reason than its size, such as an average over a cause, is not known. Log
        tau + dead time is known where the status is ok or sum_only, log tau and dead time where it is ok. Covariances
        between parameters are those of the joint posterior where a drive has one, else 0; the logarithms of noise sd and
        wanted headway, which are positive, are from their intervals.
    """
    columns = _Columns(db, kind, _texts(names), _numbers(names))
    n = len(columns.text("log"))
    estimate = np.full((n, len(names)), np.nan)
    covariance = np.full((n, len(names), len(names)), np.nan)
    for j, name in enumerate(names):
        estimate[:, j], covariance[:, j, j] = _marginal(columns, name)
    known = np.isfinite(estimate)
    for j, first in enumerate(names):
        for k, second in enumerate(names[:j]):
            both = known[:, j] & known[:, k]
            shared = np.where(both, np.nan_to_num(_joint_covariance(columns, first, second)), np.nan)
            covariance[:, j, k] = covariance[:, k, j] = shared
    excluded, keep = _excluded(columns, known)
    places = np.flatnonzero(keep)
    table = tables.drive_table(
        tuple(names),
        estimate[places],
        covariance[places],
        columns.chosen("driver", places),
        drives=columns.chosen("log", places),
        start=columns.number("start_utc")[places],
        group=columns.chosen("group_name", places),
        car=columns.chosen("car", places),
    )
    return Selection(
        kind, table, columns.number("usable")[places], excluded, tuple(_withheld_gains(columns, names))
    )


class _Columns:
    """Columns of the analysed drives of one kind, in the order of their logs, all read by one query."""

    def __init__(self, db: Any, kind: Kind, texts: Sequence[str], numbers: Sequence[str]) -> None:
        of_car = "" if kind.output in _OF_ANY_CAR else "AND coalesce(car, '') = ? "
        values = [kind.output, kind.unit, *([kind.car] if of_car else [])]
        wanted = {sql: f"coalesce(CAST({sql} AS VARCHAR), '')" for sql in texts}
        wanted |= {sql: f"CAST({sql} AS DOUBLE)" for sql in numbers}
        chosen = ", ".join(f"{cast} AS x{k}" for k, cast in enumerate(wanted.values()))
        read = db.execute(
            f"SELECT {chosen} FROM drives WHERE key IS NOT NULL AND output = ? AND coalesce(unit, '') = ? {of_car}"
            "ORDER BY coalesce(driver, ''), start_utc NULLS LAST, log",
            values,
        ).fetchnumpy()
        self._read = dict(zip(wanted, read.values(), strict=True))

    def number(self, sql: str) -> Array:
        """Numbers, (n,); NaN: not known."""
        return np.ma.filled(np.ma.asarray(self._read[sql], dtype=np.float64), np.nan)

    def text(self, sql: str) -> tuple[str, ...]:
        """Texts; "": not known."""
        return tuple(map(str, self._read[sql]))

    def chosen(self, sql: str, places: npt.NDArray[np.intp]) -> tuple[str, ...]:
        """Texts of some rows."""
        column = self.text(sql)
        return tuple(column[k] for k in places)


def _texts(names: Sequence[str]) -> list[str]:
    """What is read of each drive as a text."""
    channels = dict.fromkeys(channel for name in names if (channel := name.rpartition(".")[0]))
    of_channels = [sql for channel in channels for sql in (f"{channel}_status", _withheld(channel))]
    return ["log", "driver", "group_name", "car", _FAULTS, _WITH_PRIOR, *of_channels]


def _withheld(channel: str) -> str:
    """Why `identify` withholds the gain of a drive; "": it does not."""
    why = f"json_extract_string(identify_json, '$.whole.channels.{channel}.withheld')"
    return f"CASE WHEN {channel}_status = '{Identifiable.NOT.value}' THEN {why} END"


def _withheld_gains(columns: _Columns, names: Sequence[str]) -> Iterator[str]:
    for name in names:
        channel, _, parameter = name.rpartition(".")
        why = Counter(filter(None, columns.text(_withheld(channel)))) if parameter == "K" else Counter[str]()
        if why:
            drives = f"{why.total():,} drive{'s' * (why.total() > 1)}"
            most = "most often: " * (len(why) > 1) + why.most_common(1)[0][0]
            yield f"{label(name)} of {drives} does not count; {most}"


def _numbers(names: Sequence[str]) -> list[str]:
    """What is read as a number."""
    ends = [f'"{natural(name)[0]}{end}"' for name in names for end in ("", "_low", "_high")]
    joint = [name for name in names if "." in name]
    shared = [_shared(first, second) for k, first in enumerate(joint) for second in joint[: k + 1]]
    return ["start_utc", "usable", "gain_steps", *ends, *map(_element, joint), *shared]


def _marginal(columns: _Columns, name: str) -> tuple[Array, Array]:
    """Estimate and its variance, (n,) each; NaN where it is not known."""
    column, log = natural(name)
    value, low, high = (columns.number(f'"{column}{end}"') for end in ("", "_low", "_high"))
    with np.errstate(invalid="ignore", divide="ignore"):
        if name == _WANTED:
            # its error is symmetric, and its interval may reach below 0: the log-normal with its coefficient of variation
            mean = np.log(value)
            variance = np.log1p(((high - low) / (2.0 * NORMAL_QUANTILE * value)) ** 2)
        else:
            mean, low, high = (np.log(x) if log else x for x in (value, low, high))
            variance = ((high - low) / (2.0 * NORMAL_QUANTILE)) ** 2
    channel, _, parameter = name.rpartition(".")
    usable = np.isfinite(mean) & np.isfinite(variance) & (variance > 0.0)
    if channel:
        joint, joint_variance = columns.number(_element(name)), _joint_covariance(columns, name, name)
        there = np.isfinite(joint) & (joint_variance > 0.0)
        if parameter == "K":
            usable = (usable | there) & (np.array(columns.text(_withheld(channel)), dtype=object) == "")
        statuses = _KNOWN[parameter.removeprefix("log_")]
        usable &= np.isin(np.array(columns.text(f"{channel}_status"), dtype=object), statuses)
        there &= usable
        mean, variance = np.where(there, joint, mean), np.where(there, joint_variance, variance)
    return np.where(usable, mean, np.nan), np.where(usable, variance, np.nan)


def _element(name: str) -> str:
    return f"estimate[list_position(names, '{name}')]"


def _joint_covariance(columns: _Columns, first: str, second: str) -> Array:
    """Of the joint posterior; NaN where a drive has none, or not of these."""
    if "." not in first or "." not in second:
        return np.full(len(columns.text("log")), np.nan)
    return columns.number(_shared(first, second))


def _shared(first: str, second: str) -> str:
    at = "(list_position(names, '{}') - 1)"
    return f"covariance[{at.format(first)} * len(names) + {at.format(second)} + 1]"


def _excluded(
    columns: _Columns, known: npt.NDArray[np.bool_]
) -> tuple[tuple[Excluded, ...], npt.NDArray[np.bool_]]:
    logs, drivers = columns.text("log"), columns.text("driver")
    faults = columns.text(_FAULTS)
    steps, usable = columns.number("gain_steps"), columns.number("usable")
    leaning = columns.text(_WITH_PRIOR)
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
        return f"signals are wrong: {readable(faults)}"
    if not usable >= MIN_USABLE_S:
        return "no parameter is known: less than a minute of usable driving"
    return "no parameter is known: the driving excites too little"


def _kind(row: Mapping[str, Any]) -> Kind:
    output = str(row["output"])
    return Kind(output, str(row["unit"] or ""), "" if output in _OF_ANY_CAR else str(row["car"] or ""))
