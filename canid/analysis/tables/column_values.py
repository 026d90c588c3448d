"""Times and roles of the rows of a table, in the order of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from canid.analysis.tables import lead_rows, positions, role_values, row_order, rows, time_column
from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.headings import IDS, TIME
from canid.analysis.tables.remedies import Remedies
from canid.analysis.tables.resolution import Found
from canid.analysis.tables.source import NO_NUMBER, Source, clean
from canid.analysis.tables.times import date_column, row_clock
from canid.signals.vehicle.quoting import brief
from canid.values.errors import ConfigError
from canid.values.types import Array

# columns that the rows of the vehicle ahead can give
OF_LEAD = {"speed": "lead_speed", "length": "lead_length", "position": "lead_position"}
# and those of its centre in the plane, where a map says that they are of the centres
IN_PLANE = {"east": "lead_east", "north": "lead_north"}


def in_order(
    by_role: Mapping[str, Found],
    by: ColumnMap,
    table: rows.Rows,
    texts: set[int],
    name: str,
    says: Remedies,
) -> tuple[time_column.Times, rows.Rows, str]:
    """The rows in the order of time, whose unit is judged when they are, and a sentence where they were sorted.

    Raises:
        ConfigError: there is no time, or the rows are of several drives.
    """
    if TIME not in by_role:
        return times_of(by_role, by, table, texts, name), table, ""
    place = by_role[TIME].place
    values = [column.place for role, column in by_role.items() if role not in (TIME, *IDS)]
    times = times_of(by_role, by, table, texts, name)
    if (wrong := row_order.strays(times.t)).any():
        table = _without_times(table, place, wrong)
        times = times_of(by_role, by, table, texts, name)
    columns = [clean(table.numbers[column]) for column in values if column in table.numbers]
    clock = row_clock.unwrapped(times.t, times.zero, columns, local=times.local)
    if clock is None and place in table.numbers and by_role[TIME].rest is None:
        counts = row_clock.counted(clean(table.numbers[place]), columns)
        if counts is not None:
            table = table._replace(numbers={**table.numbers, place: counts})
            times = times_of(by_role, by, table, texts, name)
            wraps = f"{name}: {by_role[TIME].entry.names[0]}: the counter begins anew, and goes on"
            times = times._replace(note="; ".join(filter(None, (times.note, wraps))))
    if clock is not None and row_order.by_time(clock.t)[0] is None:
        note = f"{name}: {by_role[TIME].entry.names[0]}: {clock.says}"
        return times._replace(t=clock.t, note="; ".join(filter(None, (times.note, note)))), table, ""
    raw = times.t if place in texts or by_role[TIME].rest else clean(table.numbers[place])
    order, late = row_order.by_time(raw)
    # rows of several vehicles that have ids are separated by these
    note, choose = "", "" if "vehicle_id" in by_role else f"split it, or {says.rows}"
    if order is not None:
        if choose:
            row_order.check(raw, table, values, order, name, choose)
        table = row_order.taken(table, order)
        note = f"{name}: {late:,} of {table.n:,} rows were not in the order of time; they were sorted"
        times = times_of(by_role, by, table, texts, name)
        columns = [clean(table.numbers[column]) for column in values if column in table.numbers]
    column = by_role[TIME].entry.names[0]
    again = row_order.repeated(times.t, columns, f"{name}: {column}", says.counted, choose)
    return times._replace(note="; ".join(filter(None, (times.note, again)))), table, note


def _without_times(table: rows.Rows, place: int, which: npt.NDArray[np.bool_]) -> rows.Rows:
    """The rows, some of them with a time that is no number."""
    if place in table.texts:
        cells = [
            "-" if wrong else cell for cell, wrong in zip(table.texts[place], which.tolist(), strict=True)
        ]
        return table._replace(texts={**table.texts, place: cells})
    return table._replace(numbers={**table.numbers, place: np.where(which, NO_NUMBER, table.numbers[place])})


def times_of(
    by_role: Mapping[str, Found], by: ColumnMap, table: rows.Rows, texts: set[int], name: str
) -> time_column.Times:
    """Times of the rows in their order. Raises ConfigError where the column holds none."""
    if TIME not in by_role:
        return time_column.of_numbers(np.arange(float(table.n)), None, "row", by.entries[TIME].rate)
    clock = by_role[TIME]
    column = clock.entry.names[0] if len(clock.entry.names) == 1 else TIME
    unit = None if clock.unit is None else time_column.unit_name(clock.unit)
    if (
        clock.unit
        and unit is None
        and clock.unit.lower() not in ("utc", "iso", "datetime", "date", "hh:mm:ss")
    ):
        raise ConfigError(
            f'{name}: {brief(column)}: "{brief(clock.unit)}" is no unit of time; write s, ms, us or ns'
        )
    where = f"{name}: {brief(column)}"
    if clock.place in texts:
        cells = table.texts[clock.place]
        if clock.parts:
            parts = [part for part, _ in clock.parts]
            cells = date_column.joined(parts, [table.texts[place] for _, place in clock.parts], cells)
            unit = "ns" if parts == ["week"] else None
        times = time_column.of_texts(cells, unit, where)
        if clock.parts and parts == ["week"]:
            times = times._replace(note=f"{where}: {date_column.of_gps(times.start_ns)}")
    else:
        unit = unit or ("s" if clock.rest else None)
        times = time_column.of_numbers(table.numbers[clock.place], unit, where, clock.entry.rate)
    return (
        times
        if clock.rest is None
        else time_column.with_rest(times, clean(table.numbers[clock.rest[0]]), clock.rest[1])
    )


def values_of(
    by_role: Mapping[str, Found], table: rows.Rows, texts: set[int], name: str, notes: list[str]
) -> dict[str, Array]:
    """Roles of the rows in SI units, NaN where a cell is empty; what was noticed goes to `notes`."""
    values = {}
    for role, origin in by_role.items():
        if role == TIME:
            continue
        column = _cells(origin, table, texts)
        if role in IDS:
            values[role] = _codes(column, origin.entry.none)
            continue
        sign = table.numbers[origin.sign_place] if origin.sign_place >= 0 else None
        values[role] = role_values.in_si(role, origin, column, sign, name, notes)
        spoilt = int((values[role] == NO_NUMBER).sum())
        if spoilt:
            notes.append(f"{name}: {role}: {spoilt:,} of {table.n:,} cells hold no number")
    return values


def _cells(origin: Found, table: rows.Rows, texts: set[int]) -> Array | list[str]:
    """The cells of a column, or the distance of two points."""
    if origin.points:
        a, b, c, d = (clean(table.numbers[place]) for place in origin.points)
        return np.asarray(np.hypot(a - c, b - d), float)
    return table.texts[origin.place] if origin.place in texts else table.numbers[origin.place]


def _codes(column: Array | list[str], none: Sequence[float]) -> Array:
    """Ids as numbers; texts by a number that the text alone decides. NaN: none."""
    if isinstance(column, list):
        return np.array([float(hash_of(cell)) if cell.strip() else np.nan for cell in column])
    known = clean(column)
    for missing in none:
        known[known == missing] = np.nan
    return known


def hash_of(text: str) -> int:
    """A number of 50 bits for a text, the same in every run."""
    import zlib

    data = text.strip().encode()
    return zlib.crc32(data) << 18 | zlib.adler32(data) & 0x3FFFF


def lead_columns(
    source: Source,
    by_role: Mapping[str, Found],
    texts: set[int],
    table: rows.Rows,
    values: dict[str, Array],
    way: Array,
    same_place: Sequence[rows.Where],
    notes: list[str],
) -> dict[str, Array]:
    """Speed, length and position of the vehicle ahead from its own rows, where they are needed and can be found."""
    if "vehicle_id" not in by_role or TIME not in by_role or by_role[TIME].place in texts:
        return {}
    motion = "range_rate" in values or "lead_speed" in values
    distance = "gap" in values or ("spacing" in values and "lead_length" in values)
    if (motion and distance) or not ("lead_id" in by_role or {"lane", "position"} <= by_role.keys()):
        return {}
    wanted = [role for role in ("speed", "length", "position", "lane") if role in by_role]
    wanted += [role for role in IN_PLANE if role in by_role and by_role[role].entry.center]
    places = {role: by_role[role].place for role in (*wanted, "vehicle_id", TIME)}
    t = table.numbers[places[TIME]]
    ids, at = values["vehicle_id"], np.unique(t)
    of_id = places["vehicle_id"]
    lead = values.get("lead_id")
    leads = np.unique(lead[np.isfinite(lead)]) if lead is not None else None

    def keep(numbers: Mapping[int, Array], words: Mapping[int, list[str]]) -> npt.NDArray[np.bool_]:
        others = _codes(words[of_id] if of_id in texts else numbers[of_id], ())
        mask: npt.NDArray[np.bool_] = np.isin(numbers[places[TIME]], at)
        for condition in same_place:
            mask &= rows.same(
                words[condition.place] if condition.place in words else numbers[condition.place],
                condition.value,
            )
        # the rows of the only vehicle are no lead; of several each may be
        alone = ids[0] if (ids == ids[0]).all() else np.nan
        return mask & (np.isin(others, leads) if leads is not None else others != alone)

    needed = {*places.values(), *(condition.place for condition in same_place)}
    needed |= {place for role in wanted for place in by_role[role].places}
    read = rows.read(source, sorted(needed - texts), sorted(needed & texts), keep)
    if not read.n:
        return {}
    columns = {}
    for role in wanted:
        column = _cells(by_role[role], read, texts)
        if role == "lane":
            columns[role] = _codes(column, ())
        else:
            columns[role] = clean(role_values.in_si(role, by_role[role], column, None, source.name, []))
    others = lead_rows.Others(
        read.numbers[places[TIME]],
        _codes(read.texts[of_id] if of_id in texts else read.numbers[of_id], ()),
        columns,
    )
    out: dict[str, Array] = {}
    if lead is None:
        lead = lead_rows.by_lane(t, values["lane"], clean(values["position"]), way, others)
        out["lead_id"] = lead
        notes.append(f"{source.name}: the vehicle ahead: the nearest in the same lane")
    of_lead = OF_LEAD | IN_PLANE
    got = lead_rows.by_id(t, lead, others, [role for role in wanted if role in of_lead])
    for role, x in got.items():
        if of_lead[role] not in values:
            signed = role == "position" or (role == "speed" and positions.is_signed(x, way))
            out[of_lead[role]] = x * way if signed else x
    notes.append(f"{source.name}: {', '.join(out)}: from the rows of the vehicle ahead")
    return out


def timed(
    times: time_column.Times, values: dict[str, Array], name: str, notes: list[str]
) -> tuple[Array, dict[str, Array], int | None]:
    """Rows with a time."""
    t, known = times.t, np.isfinite(times.t)
    if not known.all():
        notes.append(f"{name}: {int((~known).sum()):,} of {len(t):,} rows have no time and were left out")
        t, values = t[known], {role: x[known] for role, x in values.items()}
    return t, values, times.start_ns
