"""Episodes that a table stacks by an id: one after the other in time, with pauses across which nothing is learnt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.tables import column_values, row_order, rows, time_column
from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.headings import HEADWAY, IDS, TIME
from canid.analysis.tables.lead_rows import Others, by_id
from canid.analysis.tables.resolution import Found
from canid.analysis.tables.source import clean
from canid.signals.samples.sampling_grid import MAX_PAUSE_S
from canid.signals.vehicle.quoting import brief
from canid.values.types import NAN, Array

# s; behind a pause that is longer than the grid's longest the samples are a segment of their own
PAUSE_S = MAX_PAUSE_S + 5.0
# chosen as a vehicle: all of them
ALL = "all"

_Ints = npt.NDArray[np.int64]


class Stacked(NamedTuple):
    """A table whose episodes follow each other."""

    table: rows.Rows
    times: time_column.Times
    code: _Ints  # (n,) of the episode
    note: str


def key(by_role: Mapping[str, Found], everyone: bool) -> tuple[str, ...]:
    """The columns by whose values rows belong to one episode; (): the table has none.

    Example:
        >>> key({}, everyone=True)
        ('vehicle_id',)
    """
    if "own_id" in by_role:
        return tuple(role for role in ("episode", "own_id", "lead_id") if role in by_role)
    if everyone:
        return ("vehicle_id",)
    return ("episode",) if "episode" in by_role and "vehicle_id" not in by_role else ()


def stacked(
    by_role: Mapping[str, Found],
    by: ColumnMap,
    table: rows.Rows,
    texts: set[int],
    name: str,
    roles: tuple[str, ...],
) -> Stacked | None:
    """Put the episodes one after the other.

    Args:
        by_role: the columns.
        by: the column map.
        table: its rows.
        texts: places that are read as texts.
        name: of the table.
        roles: of `key`.

    Returns:
        None where the times of a table without a map go on from one episode to the next: it is one drive.
    """
    times = column_values.times_of(by_role, by, table, texts, name)
    columns = [
        table.texts[at] if (at := by_role[role].place) in texts else clean(table.numbers[at])
        for role in roles
    ]
    code = codes(columns)
    if roles == ("episode",) and not by.entries and not begins_anew(times.t, code):
        return None
    if roles == ("episode",):
        _one_drive_each(times.t, code, by_role, table, name)
    order, t = in_turn(times.t, code)
    lengths = np.array(
        [np.ptp(part) for part in np.split(t, _joints(code[order])) if np.isfinite(part).any()]
    )
    title = " and ".join(dict.fromkeys(brief(by_role[role].entry.names[0].strip()) for role in roles))
    note = (
        f"{name}: {len(lengths):,} episodes by {title}, of {np.nanmin(lengths):.3g} to {np.nanmax(lengths):.3g} s: one "
        f"estimate over all, {np.nansum(lengths):,.0f} s; between them pauses of {PAUSE_S:g} s were put"
    )
    return Stacked(row_order.taken(table, order), time_column.Times(t, None, times.note), code[order], note)


def _one_drive_each(t: Array, code: _Ints, by_role: Mapping[str, Found], table: rows.Rows, name: str) -> None:
    """Refuse an id that stands for several drives, as the number of a trial that each subject has."""
    places = [column.place for role, column in by_role.items() if role not in (TIME, *IDS)]
    title = by_role["episode"].entry.names[0].strip()
    for part in np.split(np.argsort(code, kind="stable"), np.cumsum(np.bincount(code))[:-1]):
        order, _ = row_order.by_time(t[part])
        if order is not None:
            rows_of_one, choose = row_order.taken(table, part), "select the rows of one with --where"
            row_order.check(t[part], rows_of_one, places, order, f"{name}: one {brief(title)}", choose)


def codes(columns: Sequence[Array | list[str]]) -> _Ints:
    """Numbers of the episodes, in the order in which they come.

    Example:
        >>> codes([np.array([7.0, 7.0, 3.0]), ["a", "b", "a"]])
        array([0, 1, 2])
    """
    code = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        values, inverse = np.unique(np.asarray(column), return_inverse=True)
        code = np.unique(code * len(values) + inverse, return_inverse=True)[1]
    _, first, code = np.unique(code, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[code]


def begins_anew(t: Array, code: _Ints) -> bool:
    """Whether an episode begins before the one before it has ended.

    Example:
        >>> begins_anew(np.array([0.0, 1.0, 0.0, 1.0]), np.array([0, 0, 1, 1]))
        True
    """
    order = np.lexsort((t, code))
    order = order[np.isfinite(t[order])]
    joints = _joints(code[order])
    return bool((t[order][joints] <= t[order][joints - 1]).any())


def in_turn(t: Array, code: _Ints) -> tuple[_Ints, Array]:
    """The order by episode and time, and times that go on from one episode to the next behind a pause.

    Args:
        t: (n,) s; NaN: none.
        code: (n,) of `codes`.

    Example:
        >>> in_turn(np.array([4.0, 5.0, 4.0]), np.array([0, 0, 1]))
        (array([0, 1, 2]), array([ 0.,  1., 16.]))
    """
    order: _Ints = np.lexsort((t, code))
    out = np.full(len(t), NAN)
    begin = 0.0
    for part in np.split(np.arange(len(t)), _joints(code[order])):
        its = t[order[part]]
        if not np.isfinite(its).any():
            continue
        its = its - np.nanmin(its)
        # whole nanoseconds, as a log's
        out[part] = np.round((begin + its) * 1e9) * 1e-9
        # whole seconds: rows stay where they were between the grid's points
        begin = np.ceil(begin + np.nanmax(its) + PAUSE_S)
    return order, out


def _joints(code: _Ints) -> _Ints:
    return np.flatnonzero(np.diff(code)) + 1


def of_pairs(
    stack: Stacked, values: Mapping[str, Array]
) -> tuple[rows.Rows, time_column.Times, dict[str, Array]]:
    """The followers' rows in a table that has rows of both vehicles of each pair, with what the leaders' rows give.

    Args:
        stack: the table.
        values: roles of its rows, with `vehicle_id`, `own_id` and `lead_id`.
    """
    t = stack.times.t
    following = values["vehicle_id"] == values["own_id"]
    lead = values["vehicle_id"] == values["lead_id"]
    names = [role for role in column_values.OF_LEAD if role in values]
    code = stack.code.astype(float)
    others = Others(t[lead], code[lead], {role: clean(values[role][lead]) for role in names})
    got = by_id(t[following], code[following], others, names)
    mine = {role: x[following] for role, x in values.items()}
    ahead = {column_values.OF_LEAD[role]: x for role, x in got.items()}
    at = np.flatnonzero(following)
    table = row_order.taken(stack.table, at)._replace(n=len(at))
    return table, stack.times._replace(t=t[following]), mine | ahead


def followers(
    table: rows.Rows, times: time_column.Times, values: Mapping[str, Array], code: _Ints, name: str
) -> tuple[rows.Rows, time_column.Times, dict[str, Array], str]:
    """The rows of those vehicles of a set that have a lead at some time, and a sentence where others are left out."""
    role = next((role for role in ("lead_id", "gap", "spacing", HEADWAY) if role in values), None)
    led = np.ones(table.n, bool) if role is None else np.isfinite(clean(values[role]))
    n = int(code.max(initial=-1)) + 1
    leads = np.bincount(code, led, minlength=n) > 0.0
    if leads.all() or not leads.any():
        return table, times, dict(values), ""
    at = np.flatnonzero(leads[code])
    table = row_order.taken(table, at)._replace(n=len(at))
    kept = {role: x[at] for role, x in values.items()}
    note = f"{name}: {int((~leads).sum()):,} of {n:,} vehicles have no lead in any row and were left out"
    # the rows are in their order, and the first of them begin at 0 again
    return table, times._replace(t=in_turn(times.t[at], code[at])[1]), kept, note
