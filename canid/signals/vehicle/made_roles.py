"""Roles that are made of others: the mean of wheel speeds, headway times own speed, lead speed minus own speed.

A made role has a reading wherever the first of its parts has one; of the others it takes the latest until then.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from canid.signals.vehicle.bits import Bools, Rows
from canid.signals.vehicle.decoding_state import RoleReadings
from canid.signals.vehicle.mapping import RoleMap
from canid.values.types import NAN, Array

# by so much two wheels of one car may differ: m/s at walking pace, where their resolution and the turning circle count,
# and a share of the speed: worn and new tyres 3 %, a bend of 40 m radius 2 % to each side
SAME_SPEED, SAME_SHARE = 0.5, 0.05

# part -> s, value of its latest reading
Held = Mapping[str, tuple[float, float]]


def step(
    made: Sequence[RoleMap], held: Held, readings: Sequence[RoleReadings], t: Array, problems: Counter[str]
) -> tuple[Held, list[RoleReadings]]:
    """Put the made roles in the place of their parts.

    Args:
        made: roles that are made of others.
        held: the latest reading of each part.
        readings: of a chunk.
        t: (n,) s, of the chunk's frames.
        problems: what was left out is counted here.

    Returns:
        The latest readings, and the chunk's without the parts and with what was made of them.
    """
    by_role = {decoded.role: decoded for decoded in readings}
    parts = {part.role for role in made for part in _parts(role)}
    out = [decoded for decoded in readings if decoded.role not in parts]
    for role in made:
        new = _made(role, held, by_role, t, problems)
        if new is not None:
            out.append(new)
    news = {name: by_role[name] for name in parts & by_role.keys()}
    latest = {
        name: (float(t[decoded.row[-1]]), float(decoded.value[-1]))
        for name, decoded in news.items()
        if decoded.row.size
    }
    return {**held, **latest}, out


def _parts(role: RoleMap) -> Iterator[RoleMap]:
    for part in role.parts:
        yield part
        yield from _parts(part)


def _made(
    role: RoleMap, held: Held, by_role: dict[str, RoleReadings], t: Array, problems: Counter[str]
) -> RoleReadings | None:
    """Readings of one made role; those of made parts are added to the decoded ones."""
    for part in role.parts:
        if part.parts and part.role not in by_role:
            new = _made(part, held, by_role, t, problems)
            if new is not None:
                by_role[part.role] = new
    first = by_role.get(role.parts[0].role)
    if first is None or not first.row.size:
        return None
    columns = [first.value, *(_latest(part, first.row, held, by_role, t) for part in role.parts[1:])]
    if role.made == "mean_of":
        value, apart = mean_of_agreeing(np.stack(columns))
        for part, left_out in zip(role.parts, apart, strict=True):
            if left_out.any():
                says = f"{role.role}: {part.message}.{part.signal} left out, it differs from the others"
                problems[says] += int(left_out.sum())
    elif role.made == "headway":
        value = columns[0] * columns[1]
    else:
        value = columns[0] - columns[1]
    return RoleReadings(role.role, first.row, value)


def _latest(part: RoleMap, rows: Rows, held: Held, by_role: Mapping[str, RoleReadings], t: Array) -> Array:
    """The latest value of a part at some frames; NaN: none, or older than it may be."""
    at, before = held.get(part.role, (NAN, NAN))
    came = by_role.get(part.role)
    if came is None or not came.row.size:
        times, values = np.full(len(rows), at), np.full(len(rows), before)
    else:
        index = np.searchsorted(came.row, rows, side="right") - 1
        known = np.maximum(index, 0)
        times = np.where(index >= 0, t[came.row[known]], at)
        values = np.where(index >= 0, came.value[known], before)
    # comparisons with NaN are false
    return np.where(t[rows] - times <= part.stale, values, NAN)


def mean_of_agreeing(values: Array) -> tuple[Array, Bools]:
    """The mean of those that agree with the median: at least two, and more than half of those that are known.

    Args:
        values: (k, n) of k signals; NaN: not known.

    Returns:
        The mean (n,), NaN where they do not agree; and which signals were left out of it (k, n).

    Example:
        >>> mean, apart = mean_of_agreeing(np.array([[20.0, 0.0], [20.2, 10.0], [0.0, 20.0], [20.1, np.nan]]))
        >>> mean.round(2).tolist(), apart[:, 0].tolist()
        ([20.1, nan], [False, False, True, False])
    """
    known = np.isfinite(values)
    count = known.sum(axis=0)
    # NaN sorts last
    ordered = np.sort(values, axis=0)
    columns = np.arange(values.shape[1])
    lower, upper = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(values) - 1)
    middle = 0.5 * (ordered[lower, columns] + ordered[upper, columns])
    near = np.abs(values - middle) <= SAME_SPEED + SAME_SHARE * np.abs(middle)
    agreeing = near.sum(axis=0)
    enough = (agreeing >= 2) & (2 * agreeing > count)
    total = np.where(near, values, 0.0).sum(axis=0)
    mean = np.where(enough, total / np.maximum(agreeing, 1), NAN)
    return mean, known & ~near
