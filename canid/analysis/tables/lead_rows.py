"""The vehicle ahead in a table of many vehicles: its speed, length and position at the same time, from its own rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.tables.positions import ways
from canid.values.types import Array


class Others(NamedTuple):
    """Rows of other vehicles."""

    t: Array  # (m,) as the table has it
    id: Array  # (m,)
    columns: Mapping[str, Array]  # name -> (m,)


def by_id(t: Array, lead: Array, others: Others, names: Sequence[str]) -> dict[str, Array]:
    """Columns of the vehicles with these ids at these times; NaN where they have no row.

    Args:
        t: (n,).
        lead: (n,) ids; NaN: none.
        others: their rows.
        names: of the columns that are wanted.

    Example:
        >>> rows = Others(np.array([0.0, 1.0]), np.array([7.0, 7.0]), {"speed": np.array([20.0, 21.0])})
        >>> by_id(np.array([1.0, 2.0]), np.array([7.0, 7.0]), rows, ["speed"])["speed"]
        array([21., nan])
    """
    times, time_index = np.unique(t, return_inverse=True)
    at = np.searchsorted(times, others.t)
    at = np.minimum(at, len(times) - 1)
    ids, codes = np.unique(others.id, return_inverse=True)
    there = times[at] == others.t
    key = (codes * len(times) + at)[there]
    order = np.argsort(key, kind="stable")
    code = np.searchsorted(ids, lead)
    known = (code < len(ids)) & np.isfinite(lead)
    known &= ids[np.minimum(code, len(ids) - 1)] == lead if len(ids) else False
    wanted = code * len(times) + time_index
    place = np.searchsorted(key[order], wanted)
    hit = known & (place < len(key))
    hit[hit] = key[order][place[hit]] == wanted[hit]
    out = {}
    for name in names:
        values = np.full(len(t), np.nan)
        values[hit] = others.columns[name][there][order][place[hit]]
        out[name] = values
    return out


def by_lane(t: Array, lane: Array, position: Array, way: Array, others: Others) -> Array:
    """Id of the nearest vehicle ahead in the same lane and direction at each time; NaN: none.

    Args:
        t: (n,).
        lane: (n,).
        position: (n,) along the direction of travel.
        way: (n,) 1, or -1: the position's sign is that of the other rows turned.
        others: rows of other vehicles, with `lane` and `position` as the table has it.

    Example:
        >>> rows = Others(np.zeros(3), np.array([1.0, 2.0, 3.0]),
        ...     {"lane": np.array([1.0, 1.0, 2.0]), "position": np.array([50.0, 30.0, 20.0])})
        >>> by_lane(np.zeros(1), np.ones(1), np.array([10.0]), np.ones(1), rows)
        array([2.])
        >>> by_lane(np.zeros(1), np.ones(1), np.array([-60.0]), -np.ones(1), rows)
        array([1.])
    """
    direction = ways(others.t, others.id, others.columns["position"])
    # who hardly moves may be ahead of either direction
    rows = np.concatenate([np.flatnonzero(direction >= 0.0), np.flatnonzero(direction <= 0.0)])
    sign = np.repeat([1.0, -1.0], [(direction >= 0.0).sum(), (direction <= 0.0).sum()])
    # a direction of a lane is a lane
    lanes, places = 2.0 * others.columns["lane"][rows] + (sign < 0.0), sign * others.columns["position"][rows]
    order = np.lexsort((places, lanes, others.t[rows]))
    keys = np.rec.fromarrays([others.t[rows][order], lanes[order], places[order]])
    own_lane = 2.0 * lane + (way < 0.0)
    place = np.searchsorted(keys, np.rec.fromarrays([t, own_lane, position]), side="right")
    out = np.full(len(t), np.nan)
    inside = place < len(keys)
    at = order[place[inside]]
    same = (others.t[rows][at] == t[inside]) & (lanes[at] == own_lane[inside])
    out[inside] = np.where(same, others.id[rows][at], np.nan)
    return out
