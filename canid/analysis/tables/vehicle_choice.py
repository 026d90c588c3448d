"""Which rows of a table of several vehicles are those of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from canid.analysis.tables import row_order, rows, time_column, vehicle_ids
from canid.analysis.tables.headings import IDS, TIME
from canid.analysis.tables.remedies import Remedies
from canid.analysis.tables.resolution import Found, Resolved
from canid.analysis.tables.source import Source, clean
from canid.signals.vehicle.quoting import brief
from canid.values.errors import ConfigError
from canid.values.roles import ROLES
from canid.values.types import Array

# the map of a set of vehicles that pass a camera once, and whose ids begin anew in each period
PASSING = "NGSIM"


def text_places(source: Source, by_role: Mapping[str, Found], wheres: Sequence[rows.Where]) -> set[int]:
    """Places of columns that are read as texts."""
    sample = source.sample()
    texts = set()
    for role, column in by_role.items():
        if role == TIME:
            if column.parts or time_column.is_text(sample[column.place]):
                texts |= {column.place, *(place for _, place in column.parts)}
        elif rows.is_text(sample[column.place]) and (
            role in IDS or (role in ROLES and ROLES[role].kind == "bool")
        ):
            texts.add(column.place)
    return texts | {condition.place for condition in wheres if rows.is_text(sample[condition.place])}


def only_vehicle(
    source: Source,
    by_role: Mapping[str, Found],
    texts: set[int],
    wheres: Sequence[rows.Where],
    says: Remedies,
) -> list[rows.Where]:
    """The only vehicle there is. Raises ConfigError where there are several."""
    place = by_role["vehicle_id"].place
    shows = next((by_role[x] for x in ("lead_id", "gap", "spacing") if x in by_role), None)
    lead, none = (None, ()) if shows is None else (shows.place, shows.entry.none)
    counts = rows.vehicles(source, place, place in texts, lead, wheres, sorted(texts), none)
    if len(counts) <= 1:
        return []
    dt = _step(source, by_role, texts, wheres, counts)
    raise ConfigError(
        f"{source.name}: holds {len(counts):,} vehicles: {says.vehicle}; "
        f"{rows.listed(counts, dt, lead is not None)}{says.everyone}"
    )


def _step(
    source: Source,
    by_role: Mapping[str, Found],
    texts: set[int],
    wheres: Sequence[rows.Where],
    counts: Mapping[str, tuple[int, int]],
) -> float:
    """The time between two rows of a vehicle, s; 0.1 where there is none."""
    column = by_role.get(TIME)
    if column is None or column.place in texts:
        return 0.1
    if column.entry.rate:
        return 1.0 / column.entry.rate
    # of the vehicle with most rows: those of all may be in any order
    most = max(counts, key=lambda key: counts[key][0])
    place = by_role["vehicle_id"].place
    chosen = [*wheres, rows.Where(place, most)]
    needed = {column.place, *(each.place for each in chosen)}
    read = rows.read(source, sorted(needed - texts), sorted(needed & texts), keeper(chosen, texts))
    values = clean(read.numbers[column.place])
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    if not len(steps):
        return 0.1
    unit = time_column.unit_name(column.unit or "") or time_column.judged_unit(values)
    return float(np.median(steps)) * time_column.seconds_of(unit)


def keeper(
    wheres: Sequence[rows.Where], texts: set[int]
) -> Callable[[Mapping[int, Array], Mapping[int, list[str]]], npt.NDArray[np.bool_]] | None:
    """A function that says which rows meet all conditions; None: there is none."""
    if not wheres:
        return None

    def keep(numbers: Mapping[int, Array], words: Mapping[int, list[str]]) -> npt.NDArray[np.bool_]:
        masks = [
            rows.same(
                words[condition.place] if condition.place in texts else numbers[condition.place],
                condition.value,
            )
            for condition in wheres
        ]
        kept: npt.NDArray[np.bool_] = np.logical_and.reduce(masks)
        return kept

    return keep


def is_text_id(source: Source, by_role: Mapping[str, Found]) -> bool:
    """Whether an id that was chosen is one of a table whose ids hold a "#" themselves."""
    cells = source.sample()[by_role["vehicle_id"].place]
    return rows.is_text(cells) and any("#" in cell for cell in cells)


def one_vehicle(
    source: Source,
    resolved: Resolved,
    of_id: vehicle_ids.Columns,
    table: rows.Rows,
    times: time_column.Times,
    turn: int,
    notes: list[str],
    says: Remedies,
) -> tuple[rows.Rows, time_column.Times, list[rows.Where]]:
    """The rows of the one vehicle that an id stands for, and where the others are that are seen with it.

    Args:
        source: of the table.
        resolved: its columns.
        of_id: columns that distinguish vehicles of one id.
        table: rows of the id, in the order of time.
        times: theirs.
        turn: which of its vehicles was chosen, from 1; 0: none was.
        notes: on what was noticed.
        says: what the user can do.

    Raises:
        ConfigError: it stands for several, and none was chosen.
    """
    by_role = resolved.found
    place = by_role["vehicle_id"].place
    id_ = table.texts[place][0].strip() if place in table.texts else f"{table.numbers[place][0]:.12g}"
    passing = resolved.map.name == PASSING
    those = vehicle_ids.vehicles(times.t, table, of_id, source.headings, passing=passing)
    if turn > len(those.all) or (len(those.all) > 1 and not turn):
        stands = vehicle_ids.listed(id_, those.all, times.start_ns)
        if turn:
            raise ConfigError(f"{source.name}: vehicle {brief(id_)} stands for {len(those.all)}: {stands}")
        alone = [text for text, n in vehicle_ids.options(those.all).items() if n == 1]
        where = f', or by --where "{brief(alone[0])}"' if alone else ""
        raise ConfigError(
            f"{source.name}: vehicle {brief(id_)} is {len(those.all)} vehicles that have the same id: {stands}; choose one "
            f"by --vehicle-id {brief(id_)}#1 to {brief(id_)}#{len(those.all)}{where}"
        )
    measured = [
        column.place
        for role, column in by_role.items()
        if role in ("speed", "accel", "position", "gap", "spacing")
    ]
    columns = [clean(table.numbers[at]) for at in measured if at in table.numbers]
    if len(those.all) == 1 and vehicle_ids.at_once(times.t, columns):
        raise ConfigError(
            f"{source.name}: vehicle {brief(id_)} has several rows of the same time with other values: it is several "
            f"vehicles, which no column distinguishes; {says.rows}, or split it"
        )
    if those.pause_s:
        notes.append(
            f"{source.name}: vehicle {brief(id_)} has no row for {those.pause_s / 60:.2g} minutes: where that is "
            f"another drive, {says.rows}"
        )
    if len(those.all) > 1:
        vehicle = those.all[turn - 1]
        notes.append(
            f"{source.name}: vehicle {vehicle_ids.listed(id_, [vehicle], times.start_ns).replace('#1', f'#{turn}', 1)}"
        )
        table = row_order.taken(table, vehicle.rows)._replace(n=len(vehicle.rows))
        times = time_column.later(times, vehicle.rows)
    seen = []
    for at in of_id.where:
        cells = (
            set(table.texts[at]) if at in table.texts else {f"{x:.17g}" for x in table.numbers[at].tolist()}
        )
        seen += [rows.Where(at, cell) for cell in cells if len(cells) == 1 and cell.strip()]
    return table, times, seen
