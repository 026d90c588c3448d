"""`open_table`: a table of named columns as a log and a vehicle, and `read_table`: the same through the pipeline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid import drive_reader, pipeline
from canid.errors import ConfigError
from canid.tables import kinds, lead_rows, role_values, rows, time_column
from canid.tables.array_source import ArraySource
from canid.tables.column_map import ColumnMap, read_map
from canid.tables.headings import TIME
from canid.tables.parquet_source import ParquetSource
from canid.tables.resolution import Found, Resolved, described, resolve
from canid.tables.source import NO_NUMBER, Source, clean, number
from canid.tables.table_log import TableLog, table_log
from canid.tables.text_source import text_source
from canid.types import Array, Damage, Trace
from canid.vehicle import Vehicle
from canid.vehicle.quoting import brief, several
from canid.vehicle.roles import NEEDS, ROLES

# columns that the rows of the vehicle ahead can give
_OF_LEAD = {"speed": "lead_speed", "length": "lead_length", "position": "lead_position"}
Progress = Callable[[float], None]


class Table(NamedTuple):
    """A table, ready for the pipeline."""

    log: TableLog
    vehicle: Vehicle
    columns: str  # which column is which role, in words
    notes: tuple[str, ...]  # what was derived, taken for granted or left out, sentences
    damaged: int  # rows that could not be read


class Selection(NamedTuple):
    """Which rows of a table."""

    where: tuple[str, ...] = ()  # NAME=VALUE
    vehicle_id: str | None = None


def source_of(path: str | Path, by: ColumnMap) -> Source:
    """Open a file of columns. Raises ConfigError or LogError."""
    file = Path(path)
    if not file.exists():
        raise ConfigError(f"no such log: {path}")
    if kinds.suffix(file) == ".parquet":
        return ParquetSource(file)
    if kinds.suffix(file) == ".vbo":
        from canid.tables.vbo import read_vbo

        found = read_vbo(file)
        t: Any = found.t
        if np.isfinite(found.start_utc):
            t = np.round((found.start_utc + found.t) * 1e9).astype("datetime64[ns]")
        named = {f"{name} [{unit}]" if unit else name: x for name, (x, unit) in found.columns.items()}
        return ArraySource({TIME: t, **named}, str(path))
    return text_source(file, by.header)


def open_table(
    path: str | Path,
    by: ColumnMap | None = None,
    selection: Selection | None = None,
    progress: Progress | None = None,
) -> Table:
    r"""Read a table of named columns.

    Args:
        path: .csv, .tsv, .txt (gzipped as well), .parquet or .vbo.
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
    return table_of(source_of(path, by), by, selection or Selection(), progress)


def table_of(source: Source, by: ColumnMap, selection: Selection, progress: Progress | None = None) -> Table:
    """A table of any source; see `open_table`."""
    chosen = selection.vehicle_id
    numbered = int(chosen) if chosen is not None and chosen.isdecimal() and len(chosen) < 4 else None
    resolved = resolve(source.headings, by, source.name, numbered)
    found, notes = resolved.found, [resolved.note] if resolved.note else []
    by = resolved.map
    if TIME not in found and not (TIME in by.entries and by.entries[TIME].rate):
        raise ConfigError(
            f"{source.name}: no column of times; call it time [s] (or t, timestamp), or name it: --columns MAP.toml with "
            f'[columns] time = "NAME" (time = {{ column = "row", rate = 10 }} counts rows); it has '
            f"{several([text.strip() for text in source.headings], 12)}"
        )
    wheres = rows.wheres(selection.where, source.headings, source.name)
    texts = _texts(source, found, wheres)
    one_of_many = "vehicle_id" in found and not resolved.numbers
    if chosen is not None and not resolved.numbers:
        if not one_of_many:
            raise ConfigError(
                f"{source.name}: --vehicle-id: it has no column of vehicles' ids; select with --where NAME={brief(chosen)}"
            )
        wheres.append(rows.Where(found["vehicle_id"].place, chosen))
    if one_of_many and not any(one.place == found["vehicle_id"].place for one in wheres):
        wheres += _only_vehicle(source, found, texts, wheres)
    wanted = {place for one in found.values() for place in (one.place, one.sign_place) if place >= 0}
    wanted |= {one.place for one in wheres}
    table = rows.read(
        source, sorted(wanted - texts), sorted(wanted & texts), _keeper(wheres, texts), progress
    )
    damaged = source.damaged
    if not table.n:
        what = ", ".join(f"{source.headings[one.place].strip()}={one.value}" for one in wheres)
        lacks = f"none of its {table.read:,} rows has {brief(what)}" if what else "it has no rows"
        raise ConfigError(f"{source.name}: {lacks}")
    times = _times(found, by, table, texts, source.name)
    notes += [times.note] if times.note else []
    values = _values(found, table, texts, source.name, notes)
    values |= _lead_columns(source, found, texts, table, values, notes)
    t, values, start_ns = _ordered(times, values, source.name, notes)
    made, driver = role_values.derived(role_values.Values(values, notes), t, by.driver, source.name)
    lacking = role_values.missing(made.roles, driver, lambda task: NEEDS[task])
    if lacking:
        raise ConfigError(_lacking(source, resolved, lacking))
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
    if damaged:
        says = f"{damaged:,} of {table.read:,} rows have too few cells"
        log.spoilt = Damage(says, table.read - damaged, table.read)
    return Table(log, vehicle, described(found, source.headings), tuple(made.notes), damaged)


def _lacking(source: Source, resolved: Resolved, lacking: list[str]) -> str:
    empty = [role for role in lacking if role in resolved.found]
    known = described(resolved.found, source.headings) or "none"
    what = f"{', '.join(lacking)} {'is' if len(lacking) == 1 else 'are'} missing"
    if empty:
        return f"{source.name}: no row has a value of {', '.join(empty)}; found: {known}"
    return (
        f"{source.name}: {what}; {role_values.NEEDED}. Found: {known}; it has "
        f"{several([text.strip() for text in source.headings], 12)}. Name columns so, or in --columns MAP.toml"
    )


def _texts(source: Source, found: Mapping[str, Found], wheres: Sequence[rows.Where]) -> set[int]:
    """Places of columns that are read as texts."""
    sample = source.sample()
    texts = set()
    for role, one in found.items():
        if role == TIME:
            if time_column.is_text(sample[one.place]):
                texts.add(one.place)
        elif rows.is_text(sample[one.place]) and (
            role in ("vehicle_id", "lead_id", "lane") or (role in ROLES and ROLES[role].kind == "bool")
        ):
            texts.add(one.place)
    return texts | {one.place for one in wheres if rows.is_text(sample[one.place])}


def _only_vehicle(
    source: Source, found: Mapping[str, Found], texts: set[int], wheres: Sequence[rows.Where]
) -> list[rows.Where]:
    """The only vehicle there is. Raises ConfigError where there are several."""
    place = found["vehicle_id"].place
    lead = next((found[x].place for x in ("lead_id", "gap", "spacing") if x in found), None)
    counts = rows.vehicles(source, place, place in texts, lead, wheres, sorted(texts))
    if len(counts) <= 1:
        return []
    sample = [float(x) for x in source.sample()[found[TIME].place] if number(x) > 0] if TIME in found else []
    unit = time_column.unit_name(found[TIME].unit or "") if TIME in found else None
    rate = found[TIME].entry.rate if TIME in found else 10.0
    factor = 1.0 / rate if rate else time_column.UNITS[unit or "s"]
    steps = np.diff(np.unique(sample)) * factor if len(sample) > 1 else np.array([0.1])
    dt = float(np.median(steps)) if steps.size else 0.1
    raise ConfigError(
        f"{source.name}: holds {len(counts):,} vehicles: choose one with --vehicle-id ID; "
        f"{rows.listed(counts, dt, lead is not None)}"
    )


def _keeper(
    wheres: Sequence[rows.Where], texts: set[int]
) -> Callable[[Mapping[int, Array], Mapping[int, list[str]]], npt.NDArray[np.bool_]] | None:
    if not wheres:
        return None

    def keep(numbers: Mapping[int, Array], words: Mapping[int, list[str]]) -> npt.NDArray[np.bool_]:
        masks = [
            rows.same(words[one.place] if one.place in texts else numbers[one.place], one.value)
            for one in wheres
        ]
        kept: npt.NDArray[np.bool_] = np.logical_and.reduce(masks)
        return kept

    return keep


def _times(
    found: Mapping[str, Found], by: ColumnMap, table: rows.Rows, texts: set[int], name: str
) -> time_column.Times:
    if TIME not in found:
        return time_column.of_numbers(np.arange(float(table.n)), None, "row", by.entries[TIME].rate)
    one = found[TIME]
    column = one.entry.names[0] if len(one.entry.names) == 1 else TIME
    unit = None if one.unit is None else time_column.unit_name(one.unit)
    if one.unit and unit is None and one.unit.lower() not in ("utc", "iso", "datetime", "date", "hh:mm:ss"):
        raise ConfigError(
            f'{name}: {brief(column)}: "{brief(one.unit)}" is no unit of time; write s, ms, us or ns'
        )
    where = f"{name}: {brief(column)}"
    if one.place in texts:
        return time_column.of_texts(table.texts[one.place], unit, where)
    return time_column.of_numbers(table.numbers[one.place], unit, where, one.entry.rate)


def _values(
    found: Mapping[str, Found], table: rows.Rows, texts: set[int], name: str, notes: list[str]
) -> dict[str, Array]:
    values = {}
    for role, one in found.items():
        if role == TIME:
            continue
        column: Array | list[str] = table.texts[one.place] if one.place in texts else table.numbers[one.place]
        if role in ("vehicle_id", "lead_id", "lane"):
            values[role] = _codes(column, one.entry.none)
            continue
        sign = table.numbers[one.sign_place] if one.sign_place >= 0 else None
        values[role] = role_values.in_si(role, one, column, sign, name, notes)
        spoilt = int((values[role] == NO_NUMBER).sum())
        if spoilt:
            notes.append(f"{name}: {role}: {spoilt:,} of {table.n:,} cells hold no number")
    return values


def _codes(column: Array | list[str], none: Sequence[float]) -> Array:
    """Ids as numbers; texts by a number that the text alone decides. NaN: none."""
    if isinstance(column, list):
        return np.array([float(hash_of(cell)) if cell.strip() else np.nan for cell in column])
    known = clean(column)
    for one in none:
        known[known == one] = np.nan
    return known


def hash_of(text: str) -> int:
    """A number of 50 bits for a text, the same in every run."""
    import zlib

    data = text.strip().encode()
    return zlib.crc32(data) << 18 | zlib.adler32(data) & 0x3FFFF


def _lead_columns(
    source: Source,
    found: Mapping[str, Found],
    texts: set[int],
    table: rows.Rows,
    values: dict[str, Array],
    notes: list[str],
) -> dict[str, Array]:
    """Speed, length and position of the vehicle ahead from its own rows, where they are needed and can be found."""
    if "vehicle_id" not in found or TIME not in found or found[TIME].place in texts:
        return {}
    motion = "range_rate" in values or "lead_speed" in values
    distance = "gap" in values or ("spacing" in values and "lead_length" in values)
    if (motion and distance) or not ("lead_id" in found or {"lane", "position"} <= found.keys()):
        return {}
    wanted = [role for role in ("speed", "length", "position", "lane") if role in found]
    places = {role: found[role].place for role in (*wanted, "vehicle_id", TIME)}
    t = table.numbers[places[TIME]]
    ids, at = values["vehicle_id"], np.unique(t)
    of_id = places["vehicle_id"]
    lead = values.get("lead_id")
    leads = np.unique(lead[np.isfinite(lead)]) if lead is not None else None

    def keep(numbers: Mapping[int, Array], words: Mapping[int, list[str]]) -> npt.NDArray[np.bool_]:
        others = _codes(words[of_id] if of_id in texts else numbers[of_id], ())
        mask: npt.NDArray[np.bool_] = np.isin(numbers[places[TIME]], at)
        return mask & (np.isin(others, leads) if leads is not None else others != ids[0])

    as_numbers = sorted({*places.values()} - texts)
    read = rows.read(source, as_numbers, sorted({*places.values()} & texts), keep)
    if not read.n:
        return {}
    columns = {}
    for role in wanted:
        column: Array | list[str] = (
            read.texts[places[role]] if places[role] in texts else read.numbers[places[role]]
        )
        if role == "lane":
            columns[role] = _codes(column, ())
        else:
            columns[role] = clean(role_values.in_si(role, found[role], column, None, source.name, []))
    others = lead_rows.Others(
        read.numbers[places[TIME]],
        _codes(read.texts[of_id] if of_id in texts else read.numbers[of_id], ()),
        columns,
    )
    out: dict[str, Array] = {}
    if lead is None:
        lead = lead_rows.by_lane(t, values["lane"], clean(values["position"]), others)
        out["lead_id"] = lead
        notes.append(f"{source.name}: the vehicle ahead: the nearest in the same lane")
    got = lead_rows.by_id(t, lead, others, [role for role in wanted if role in _OF_LEAD])
    out |= {_OF_LEAD[role]: x for role, x in got.items() if _OF_LEAD[role] not in values}
    notes.append(f"{source.name}: {', '.join(out)}: from the rows of the vehicle ahead")
    return out


def _ordered(
    times: time_column.Times, values: dict[str, Array], name: str, notes: list[str]
) -> tuple[Array, dict[str, Array], int | None]:
    """Rows with a time; a table that begins with the newest is turned round."""
    t, start = times.t, times.start_ns
    known = np.isfinite(t)
    if not known.all():
        notes.append(f"{name}: {int((~known).sum()):,} of {len(t):,} rows have no time and were left out")
        t, values = t[known], {role: x[known] for role, x in values.items()}
    steps = np.diff(t)
    if len(t) > 1 and (steps < 0).sum() > 0.5 * len(steps):
        t, values = t[::-1], {role: x[::-1] for role, x in values.items()}
        notes.append(f"{name}: its rows begin with the latest; they were turned round")
        if start is not None:
            start += round(1e9 * float(t[0]))
        # whole nanoseconds, as a log's
        t = np.round((t - t[0]) * 1e9) * 1e-9
    return t, values, start


def read_table(
    path: str | Path,
    columns: ColumnMap | str | Path | None = None,
    *,
    where: Sequence[str] = (),
    vehicle_id: str | int | None = None,
    dt: float = pipeline.DT,
) -> Trace:
    r"""Read a table of named columns as uniform columns, through the same path as a CAN log.

    Args:
        path: .csv, .tsv, .txt (gzipped as well), .parquet or .vbo, with columns such as time, pedal, speed [km/h], gap.
        columns: a column map: a TOML file, or a shipped one: ngsim, highd, openacc, openpilot, follownet.
        where: NAME=VALUE: rows whose column has this value.
        vehicle_id: of one vehicle, in a table of several.
        dt: step of the grid, s.

    Raises:
        ConfigError: a column is missing, or there are several vehicles and none was chosen.
        LogError: it cannot be read.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "drive.csv"
        >>> _ = path.write_text("time,pedal,speed,gap,range_rate\n" + "".join(
        ...     f"{0.1 * k:.1f},20,20,30,0\n" for k in range(50)))
        >>> float(read_table(path).signals["headway"][10])
        1.5
    """
    by = columns if isinstance(columns, ColumnMap) or columns is None else read_map(columns)
    chosen = Selection(tuple(where), None if vehicle_id is None else str(vehicle_id))
    return trace_of(open_table(path, by, chosen), dt)


def trace_of(table: Table, dt: float) -> Trace:
    """A table through the pipeline."""
    read = drive_reader.read_drive(table.log.path, table.vehicle, dt=dt, estimating=False, log=table.log)
    return read.trace
