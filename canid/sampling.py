"""Readings at any rate → the values of all roles on a uniform grid, by timestamp.

Numbers are interpolated between the readings before and after the grid point: holding the last value of a 20 Hz
radar would put 20 ms of dead time into the driver. Switches are held.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from typing import NamedTuple

from canid.types import NAN, Reading

# s; how long a grid point waits for the reading after it. Twice the smoothing lag, plus two reports of a 10 Hz radar
WAIT = 0.6
# readings kept per role: WAIT at 200 Hz
KEPT = 120
# s; grid points before the first reading of every needed role are left out, but for no longer than this: a
# signal that is still missing then is missing
BEGIN = 1.0
# s; after a pause longer than this the grid goes on behind the pause: nothing is known inside it
PAUSE = 10.0


class Role(NamedTuple):
    """How a role is sampled."""

    switch: bool = False  # held, not interpolated
    stale: float = 0.5  # s; older than this is NaN
    needed: bool = False  # a grid point waits for it


class State(NamedTuple):
    """Readings not yet used up, and the next grid point."""

    times: dict[str, list[float]]  # role -> times of its readings, ascending
    values: dict[str, list[float]]
    next: int = 0  # index of the next grid point


# Roles that lead.step makes, whatever the vehicle maps.
MADE = {
    "lead_valid": Role(switch=True, stale=1.0),
    "target": Role(switch=True, stale=60.0),
}


def init() -> State:
    """Return the state before the first reading."""
    return State({}, {})


def put(state: State, reading: Reading) -> State:
    """Take one reading; one that is not later than its role's last is ignored."""
    times = state.times.get(reading.role, [])
    if times and reading.t <= times[-1]:
        return state
    # lists are replaced, never changed in place: an older state stays what it was
    values = state.values.get(reading.role, [])
    return state._replace(
        times={**state.times, reading.role: [*times[-KEPT:], reading.t]},
        values={**state.values, reading.role: [*values[-KEPT:], reading.value]},
    )


def take(
    state: State, now: float, dt: float, roles: Mapping[str, Role]
) -> tuple[State, list[tuple[float, dict[str, float]]]]:
    """Give out the grid points that are complete at time `now`.

    Args:
        state: from `put`.
        now: session time, s.
        dt: the grid's step, s.
        roles: how each role is sampled.

    Returns:
        the next state and (t, {role: value}) per grid point; NaN = not measured then.

    Example:
        >>> state = init()
        >>> for k in range(4):
        ...     state = put(state, Reading(0.06 * k, "speed", 6.0 * k))
        >>> state, points = take(state, 0.18, 0.1, {"speed": Role(needed=True)})
        >>> [(t, round(value["speed"], 9)) for t, value in points]
        [(0.0, 0.0), (0.1, 10.0)]
    """
    points = []
    index = state.next
    if now - index * dt > PAUSE:
        index = int((now - WAIT) / dt)
    while True:
        t = index * dt
        if now < t or (now < t + WAIT and not _complete(state, t, roles)):
            break
        index += 1
        if t >= BEGIN or _begun(state, t, roles):
            points.append((t, {role: _at(state, role, t, how) for role, how in roles.items()}))
    if index == state.next:
        return state, points
    return _trim(state, index * dt)._replace(next=index), points


def _trim(state: State, t: float) -> State:
    """Drop what no grid point from t on can need: all but the last reading before it."""
    times, values = {}, {}
    for role, of in state.times.items():
        first = max(bisect_right(of, t) - 1, 0)
        times[role], values[role] = of[first:], state.values[role][first:]
    return state._replace(times=times, values=values)


def _complete(state: State, t: float, roles: Mapping[str, Role]) -> bool:
    return all(
        bool(state.times.get(role)) and state.times[role][-1] >= t
        for role, how in roles.items()
        if how.needed
    )


def _begun(state: State, t: float, roles: Mapping[str, Role]) -> bool:
    return all(
        bool(state.times.get(role)) and state.times[role][0] <= t for role, how in roles.items() if how.needed
    )


def _at(state: State, role: str, t: float, how: Role) -> float:
    """Value of a role at t: interpolated, or held where nothing later came; NaN when too old."""
    times = state.times.get(role)
    if not times:
        return NAN
    after = bisect_right(times, t)
    if after == 0:
        return NAN
    values = state.values[role]
    before_t, before = times[after - 1], values[after - 1]
    if before_t == t:
        return before
    if how.needed and after == len(times) and how.stale <= WAIT:
        return NAN  # waited for longer than it may be old: this is the edge of a hole
    if how.switch or after == len(times):
        return before if t - before_t <= how.stale else NAN
    span = times[after] - before_t
    if span > how.stale:
        return NAN
    return before + (values[after] - before) * ((t - before_t) / span)
