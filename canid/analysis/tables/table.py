"""A table of named columns as a log and a vehicle, which go through the same pipeline as a CAN log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.analysis.drive import drive_reader
from canid.analysis.tables import (
    column_values,
    episodes,
    positions,
    role_values,
    rows,
    time_column,
    unstated_units,
    vehicle_choice,
    vehicle_ids,
)
from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.headings import TIME, heading
from canid.analysis.tables.remedies import COMMAND_LINE, Remedies, remedy_of
from canid.analysis.tables.resolution import Found, Resolved, described, resolve
from canid.analysis.tables.source import EMPTY, Source, clean
from canid.analysis.tables.sources.open_source import source_of
from canid.analysis.tables.table_log import TableLog, table_log
from canid.analysis.tables.times import date_column
from canid.io.logs.text_lines import Line, LineCount
from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.quoting import brief, several
from canid.values.errors import ConfigError, DamagedLogError
from canid.values.roles import NEEDS
from canid.values.types import Array, Trace

# columns that name what a row is of, in tables of one value a row
_NAMES_OF_SIGNALS = {
    "pid",
    "signal",
    "name",
    "signal_name",
    "parameter",
    "channel",
    "measurement",
    "variable",
}
Progress = Callable[[float], None]


class Table(NamedTuple):
    """A table, ready for the pipeline."""

    log: TableLog
    vehicle: Vehicle
    columns: str  # which column is which role, in words
    notes: tuple[str, ...]  # what was derived, taken for granted or left out, sentences
    damaged: int  # lines that could not be read
    sorted: str  # a sentence, where rows were not in the order of time
    judged: tuple[str, ...] = ()  # those of the notes that say how the headings were read, where no map does


class Selection(NamedTuple):
    """Which rows of a table."""

    where: tuple[str, ...] = ()  # NAME=VALUE
    vehicle_id: str | None = None
    named: bool = False  # the columns' names are roles; none is judged by its values


def open_table(
    path: str | Path,
    by: ColumnMap | None = None,
    selection: Selection | None = None,
    progress: Progress | None = None,
) -> Table:
    r"""Read a table of named columns.

    Args:
        path: .csv, .tsv, .txt (gzipped as well), .parquet, .vbo, or .mf4 and .mcap with decoded signals.
        by: from `column_map.read_map`; None: columns are found by their headings.
        selection: of its rows.
        progress: called with the share that was read.

    Raises:
        ConfigError: a column is missing, or there are several vehicles and none was chosen.
        LogError: it cannot be read.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "drive.csv"
        >>> _ = path.write_text("time,pedal,speed [km/h],gap,range_rate\n0,20,72,30,0\n0.1,20,72,30,0\n")
        >>> open_table(path).columns
        'time = time, pedal = pedal, speed = speed [km/h], gap = gap, range_rate = range_rate'
    """
    by = by or ColumnMap()
    source = source_of(path, by)
    try:
        return table_of(source, by, selection or Selection(), progress)
    except ConfigError as error:
        # what is missing may be what the file has in another form
        more = [*source.notes, *filter(None, [remedy_of(source.headings)])]
        raise (ConfigError("; ".join([str(error), *more])) if more else error) from None


def table_of(
    source: Source,
    by: ColumnMap,
    selection: Selection,
    progress: Progress | None = None,
    says: Remedies = COMMAND_LINE,
) -> Table:
    """A table of any source; see `open_table`. `says`: what the user can do, for messages."""
    chosen, turn = (None, 0) if selection.vehicle_id is None else vehicle_ids.numbered(selection.vehicle_id)
    numbered = int(chosen) if chosen is not None and chosen.isdecimal() and len(chosen) < 4 else None
    resolved = resolve(source.headings, by, source.name, numbered, says, None if selection.named else source)
    by_role = date_column.with_dates(source, resolved.found)
    notes = [*source.notes, *resolved.notes]
    by = resolved.map
    judged = () if by.entries else resolved.notes
    if TIME not in by_role and not (TIME in by.entries and by.entries[TIME].rate):
        raise ConfigError(
            f"{source.name}: no column of times; call it time [s] (or t, timestamp), or name it: "
            f"{says.column(TIME)}{says.counted}; it has "
            f"{several([text.strip() for text in source.headings], 12)}"
        )
    wheres = rows.wheres(selection.where, source.headings, source.name)
    texts = vehicle_choice.text_places(source, by_role, wheres)
    # a vehicle may be called so itself
    everyone = (
        chosen == episodes.ALL
        and "vehicle_id" in by_role
        and not resolved.numbers
        and episodes.ALL not in source.sample()[by_role["vehicle_id"].place]
    )
    stacked_by = episodes.key(by_role, everyone)
    one_of_many = "vehicle_id" in by_role and not resolved.numbers and not stacked_by
    if chosen is not None and turn and (not one_of_many or vehicle_choice.is_text_id(source, by_role)):
        chosen, turn = selection.vehicle_id, 0  # an id that holds a "#" itself
    if chosen is not None and not resolved.numbers and not everyone:
        # of pairs the follower is chosen; where no vehicle has an id, an episode
        ids = [role for role in ("own_id", "vehicle_id", "episode") if role in by_role]
        if not ids:
            raise ConfigError(
                f"{source.name}: --vehicle-id: it has no column of vehicles' ids; select with --where NAME={brief(chosen)}"
            )
        wheres.append(rows.Where(by_role[ids[0]].place, chosen))
    if one_of_many and not any(condition.place == by_role["vehicle_id"].place for condition in wheres):
        wheres += vehicle_choice.only_vehicle(source, by_role, texts, wheres, says)
    wanted = {place for column in by_role.values() for place in column.places}
    wanted |= {condition.place for condition in wheres}
    of_id = vehicle_ids.Columns((), (), -1)
    if one_of_many and TIME in by_role:
        of_id = vehicle_ids.columns_of(source.headings, (by_role["vehicle_id"].place, by_role[TIME].place))
        sample = source.sample()
        texts |= {place for place in of_id.where if rows.is_text(sample[place])}
        wanted |= {*of_id.all}
    table = rows.read(
        source, sorted(wanted - texts), sorted(wanted & texts), vehicle_choice.keeper(wheres, texts), progress
    )
    if not table.n:
        damage = source.count.damage("rows")
        if damage is not None:
            raise DamagedLogError(f"{source.name} holds no row that can be read ({damage.says})")
        what = ", ".join(
            f"{source.headings[condition.place].strip()}={condition.value}" for condition in wheres
        )
        lacks = f"none of its {source.count.read:,} rows has {brief(what)}" if what else "it has no rows"
        raise ConfigError(f"{source.name}: {lacks}")
    stacked = episodes.stacked(by_role, by, table, texts, source.name, stacked_by) if stacked_by else None
    if stacked is None:
        times, table, order = column_values.in_order(by_role, by, table, texts, source.name, says)
        notes += [order] if order else []
    else:
        table, times, order = stacked.table, stacked.times, ""
        notes.append(stacked.note)
        judged += () if by.entries else (stacked.note,)
    notes += [times.note] if times.note else []
    same_place: list[rows.Where] = []
    if one_of_many and TIME in by_role:
        table, times, same_place = vehicle_choice.one_vehicle(
            source, resolved, of_id, table, times, turn, notes, says
        )
    values = column_values.values_of(by_role, table, texts, source.name, notes)
    if stacked is not None and "own_id" in by_role:
        table, times, values = episodes.of_pairs(stacked, values)
    else:
        of_vehicle = np.zeros(table.n) if stacked is None else stacked.code.astype(float)
        way = positions.turned(times.t, of_vehicle, values, by_role, source.name, notes)
        values |= column_values.lead_columns(source, by_role, texts, table, values, way, same_place, notes)
        if stacked is not None and everyone:
            table, times, values, note = episodes.followers(table, times, values, stacked.code, source.name)
            notes += [note] if note else []
    if one_of_many and "lead_id" in values and not np.isfinite(values["lead_id"]).any():
        raise ConfigError(
            f"{source.name}: the vehicle has none ahead in any of its {len(times.t):,} rows; choose another one"
        )
    positions.fronts(values, by_role)
    _count_times(times, by_role, table, source.count)
    t, values, start_ns = column_values.timed(times, values, source.name, notes)
    if not selection.named:  # arrays are in SI by the contract of their function
        _judge_units(t, values, by_role, source.name)
    made, driver = role_values.derived(role_values.Values(values, notes), t, by.driver, source.name)
    lacking = role_values.missing(made.roles, driver, lambda task: NEEDS[task])
    if lacking:
        raise ConfigError(_lacking(source, resolved, lacking, says))
    log, vehicle = table_log(
        source.name,
        t,
        made.roles,
        start_ns,
        driver,
        by.name or "named columns",
        by.estimators,
        by.stale,
        by.path,
    )
    log.count = source.count
    columns = described(by_role, source.headings)
    return Table(log, vehicle, columns, tuple(made.notes), source.count.bad, order, judged)


def _judge_units(t: Array, values: Mapping[str, Array], by_role: Mapping[str, Found], name: str) -> None:
    """Raise ConfigError where a unit that is not stated is another one than was taken."""
    has = {role: clean(values[role]) for role in ("speed", "gap", "range_rate") if role in values}
    clock, why, rate = by_role.get(TIME), "", has.get("range_rate")
    if rate is None and {"lead_speed", "speed"} <= values.keys():
        rate = clean(values["lead_speed"]) - has["speed"]
    if (
        clock is not None
        and clock.unit is None
        and clock.entry.rate is None
        and "gap" in has
        and rate is not None
    ):
        why = unstated_units.of_times(t, has["gap"], rate)
    if why:
        raise ConfigError(
            f"{name}: {why}: state the units of time, gap and range rate, such as time [ms] or [10us]"
        )
    pair = {role: by_role[role].unit for role in ("gap", "range_rate") if role in has and role in by_role}
    if len(pair) > 1 and None in pair.values():
        why = unstated_units.of_gap(t, has["gap"], has["range_rate"])
    if why:
        raise ConfigError(f"{name}: {why}: state the units of gap and range rate, such as gap [m]")
    if "speed" in has and by_role["speed"].unit is None:
        why = unstated_units.of_speed(t, has["speed"], has.get("range_rate"))
    if why:
        raise ConfigError(
            f"{name}: speed: no unit is stated, and {why}; state it, such as speed [mph], [km/h] or [m/s]"
        )


def _count_times(
    times: time_column.Times, by_role: Mapping[str, Found], table: rows.Rows, count: LineCount
) -> None:
    """Count the rows whose cell of the time holds none: one that is not empty is damaged."""
    known = table.lines[np.isfinite(times.t)]
    for k in np.flatnonzero(~np.isfinite(times.t)).tolist():
        count.read -= 1
        place = by_role[TIME].place
        empty = (
            not table.texts[place][k].strip() if place in table.texts else table.numbers[place][k] == EMPTY
        )
        if empty:
            count.others["rows without a time"] += 1
        else:
            number = int(table.lines[k])
            word = count.rows_in_words.get(number, "") if number > known.max(initial=0) else ""
            count.miss(Line(word, number, True), "its time is damaged")
    count.settle()


def _lacking(source: Source, resolved: Resolved, lacking: list[str], says: Remedies) -> str:
    empty = [role for role in lacking if role in resolved.found]
    known = described(resolved.found, source.headings) or "none"
    what = f"{', '.join(lacking)} {'is' if len(lacking) == 1 else 'are'} missing"
    names = {heading(text).name for text in source.headings}
    if "value" in names and names & _NAMES_OF_SIGNALS:
        what += " (its rows hold one value each, of a signal that another cell names: make a column of each signal)"
    if empty:
        return f"{source.name}: no row has a value of {', '.join(empty)}; found: {known}"
    return (
        f"{source.name}: {what}; {role_values.NEEDED}. Found: {known}; it has "
        f"{several([text.strip() for text in source.headings], 12)}. {says.columns}"
    )


def trace_of(table: Table, dt: float) -> Trace:
    """A table through the pipeline."""
    read = drive_reader.read_drive(table.log.path, table.vehicle, dt=dt, estimating=False, log=table.log)
    return read.trace
