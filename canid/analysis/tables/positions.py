"""Positions along the road, as gaps are made of them: counted in the direction of travel, of the vehicles' fronts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from canid.analysis.tables.resolution import Found
from canid.analysis.tables.source import EMPTY, NO_NUMBER, clean
from canid.values.types import Array

# m; a vehicle that moved less in all its rows has no direction: noise of positions from video is below 1 m
_MIN_TRAVEL_M = 5.0
# times the 90 % quantile of the steps; a longer one is where the position begins anew, as on the next lane of SUMO
_MAX_STEP = 4.0
# values that have a sign along the road, where the speed has
_SIGNED = ("speed", "lead_speed", "accel")


def ways(t: Array, ids: Array, position: Array) -> Array:
    """The direction of travel of each row's vehicle: 1, -1, or 0 where it hardly moves.

    Args:
        t: (n,) times.
        ids: (n,) of the vehicles.
        position: (n,) m; NaN: none.

    Example:
        >>> ways(np.array([0.0, 1.0, 0.0, 1.0]), np.array([1.0, 1.0, 2.0, 2.0]), np.array([0.0, 20.0, 20.0, 0.0]))
        array([ 1.,  1., -1., -1.])
    """
    known = np.flatnonzero(np.isfinite(position) & np.isfinite(ids))
    order = known[np.lexsort((t[known], ids[known]))]
    vehicles, vehicle = np.unique(ids[order], return_inverse=True)
    step = np.diff(position[order])
    step[np.diff(vehicle) != 0] = 0.0
    moves = np.abs(step[step != 0.0])
    if moves.size:
        step[np.abs(step) > _MAX_STEP * np.quantile(moves, 0.9)] = 0.0
    travel = np.bincount(vehicle[1:], step, minlength=len(vehicles))
    out = np.zeros(len(t))
    out[order] = np.where(np.abs(travel) > _MIN_TRAVEL_M, np.sign(travel), 0.0)[vehicle]
    return out


def turned(
    t: Array, ids: Array, values: dict[str, Array], by_role: Mapping[str, Found], name: str, notes: list[str]
) -> Array:
    """Turn the values of vehicles that drive towards negative positions.

    Args:
        t: (n,) times.
        ids: (n,) of the vehicles.
        values: by role; those that have a sign along the road are replaced.
        by_role: the columns.
        name: of the table.
        notes: takes what was turned.

    Returns:
        (n,) the direction of travel: 1 or -1.
    """
    way = np.ones(len(t))
    if "position" not in values:
        return way
    back = ways(t, ids, clean(values["position"])) < 0.0
    if not back.any():
        return way
    way[back] = -1.0
    roles: list[str] = [role for role in ("position", "lead_position") if role in values]
    if "speed" in values and is_signed(clean(values["speed"]), way):
        # what has the sign of another column has it already
        roles += [role for role in _SIGNED if role in values and by_role[role].sign_place < 0]
    for role in roles:
        x = values[role]
        values[role] = np.where((x == EMPTY) | (x == NO_NUMBER), x, x * way)
    notes.append(
        f"{name}: {', '.join(roles)}: turned in {int(back.sum()):,} of {len(t):,} rows, which drive towards lower positions"
    )
    return way


def is_signed(speed: Array, way: Array) -> bool:
    """Whether speeds are negative where vehicles drive towards lower positions.

    Args:
        speed: (n,) m/s; NaN: none.
        way: (n,) of `turned`.

    Example:
        >>> is_signed(np.array([20.0, -21.0]), np.array([1.0, -1.0]))
        True
    """
    back = speed[(way < 0.0) & np.isfinite(speed)]
    return bool(back.size) and float(np.median(back)) < 0.0


def fronts(values: dict[str, Array], by_role: Mapping[str, Found]) -> None:
    """Positions of the fronts where the columns have those of the centres, by the lengths."""
    for role, length, origin in (
        ("position", "length", "position"),
        ("lead_position", "lead_length", "lead_position" if "lead_position" in by_role else "position"),
    ):
        if role in values and origin in by_role and by_role[origin].entry.center:
            # without a length there is no front
            half = clean(values[length]) / 2.0 if length in values else np.full(len(values[role]), np.nan)
            values[role] = clean(values[role]) + half
