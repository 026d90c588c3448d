"""Readings on the uniform grid, as canid's `sampling_grid` gives them out frame by frame, all grid points at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.signals.samples import local_polynomial, sampling_grid
from tests.plants.planted_drive import Array


class Came(NamedTuple):
    """One role's readings."""

    t: Array  # (m,) s, ascending
    value: Array  # (m,)
    known: Array  # (m,) s, ascending: when canid had it


def sampled(
    came: Mapping[str, Came], roles: Mapping[str, sampling_grid.Role], frames: Array, dt: float
) -> tuple[Array, dict[str, Array]]:
    """Bring readings onto the grid.

    Args:
        came: role -> its readings; a role that never came is NaN.
        roles: how each is sampled, as in `canid.signals.samples.sampling_grid.take`.
        frames: (f,) s, ascending: when any frame came.
        dt: s.

    Returns:
        (n,) s and role -> (n,).
    """
    t = np.arange(int(frames[-1] / dt) + 1) * dt
    needed = [came[role] for role, how in roles.items() if how.needed and role in came]
    complete = len(needed) == sum(how.needed for how in roles.values())
    # a grid point is given out once all that it needs is known, or the wait is over; and never before an earlier one
    ready = np.max([_when(c, t) for c in needed], axis=0) if complete else np.full(len(t), np.inf)
    given = np.maximum.accumulate(np.minimum(ready, _after(frames, t + sampling_grid.MAX_WAIT_S)))
    begun = max((c.t[0] for c in needed), default=np.inf) if complete else np.inf
    out = np.isfinite(given) & ((t >= sampling_grid.MAX_START_S) | (t >= begun))
    t, given = t[out], given[out]
    return t, {role: _values(came.get(role), t, given, how) for role, how in roles.items()}


def _after(frames: Array, t: Array) -> Array:
    """Time of the first frame at or after each t; infinite: none."""
    return np.append(frames, np.inf)[np.searchsorted(frames, t, side="left")]


def _when(came: Came, t: Array) -> Array:
    """When the first reading at or after each t was known."""
    return np.append(came.known, np.inf)[np.searchsorted(came.t, t, side="left")]


def _values(came: Came | None, t: Array, given: Array, how: sampling_grid.Role) -> Array:
    if came is None:
        return np.full(len(t), np.nan)
    count = np.searchsorted(came.known, given, side="right")
    after = np.minimum(np.searchsorted(came.t, t, side="right"), count)
    last = np.maximum(after - 1, 0)
    next_ = np.minimum(after, len(came.t) - 1)
    before_t, before = came.t[last], came.value[last]
    alone = after == count  # nothing later came in time
    span = came.t[next_] - before_t
    with np.errstate(invalid="ignore", divide="ignore"):
        between = before + (came.value[next_] - before) * ((t - before_t) / span)
    held = np.where(t - before_t <= how.stale, before, np.nan)
    out = np.where(alone | how.switch, held, np.where(span > how.stale, np.nan, between))
    if how.needed and how.stale <= sampling_grid.MAX_WAIT_S:
        out = np.where(alone, np.nan, out)
    out = np.where(before_t == t, before, out)
    out = np.where(after == 0, np.nan, out)
    return _smooth(came, t, count, out, how) if how.smooth else out


def _smooth(came: Came, t: Array, count: Array, joined: Array, how: sampling_grid.Role) -> Array:
    """Local parabolas through the readings that had come; joined by lines where they are too few."""
    out, reach = joined.copy(), max(how.smooth, how.widest)
    squares = local_polynomial.noise(came.t, came.value).tolist() if how.widest else []
    low = np.searchsorted(came.t, t - reach)
    high = np.minimum(np.searchsorted(came.t, t + reach), count)
    for i in np.flatnonzero(np.isfinite(joined)).tolist():
        near = slice(low[i], high[i])
        x, y = (came.t[near] - t[i]).tolist(), came.value[near].tolist()
        found = local_polynomial.smooth(x, y, squares[near], how.smooth).value
        out[i] = found if found == found else joined[i]
    return out
