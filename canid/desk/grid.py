"""`sampling.put` and `sampling.take` for many readings: the values of all roles on the grid, as they were live.

Live, a grid point is given out with the frame that completes it, from the readings that had come by then. So each
reading carries the number of the frame that brought it, and each point looks only at what came before its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid import sampling
from canid.sampling import BEGIN, KEPT, PAUSE, WAIT
from canid.types import NAN, Array

Ints = npt.NDArray[np.int64]


class Readings(NamedTuple):
    """One role's readings, times ascending."""

    t: Array  # (n,) s
    value: Array  # (n,)
    frame: Ints  # (n,) number of the frame that brought it
    before: int = 0  # readings that came earlier and are forgotten


class State(NamedTuple):
    """Readings not yet used up, and the next grid point."""

    readings: Mapping[str, Readings] = {}
    next: int = 0  # index of the next grid point
    frames: int = 0  # that have come
    latest: float = 0.0  # s, session time of the newest


class Points(NamedTuple):
    """Grid points."""

    t: Array  # (m,) s
    values: dict[str, Array]  # role -> (m,); NaN = not measured then


_NONE = Readings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def put(state: State, role: str, t: Array, value: Array, frame: Ints) -> State:
    """Take readings of one role, in the order in which they came; one not later than the one before is ignored.

    Example:
        >>> state = put(State(), "speed", np.array([0.0, 0.1, 0.1]), np.array([5.0, 6.0, 7.0]), np.arange(3))
        >>> state.readings["speed"].value.tolist()
        [5.0, 6.0]
    """
    old = state.readings.get(role, _NONE)
    last = old.t[-1] if old.t.size else -np.inf
    newest = np.maximum.accumulate(np.concatenate([[last], t]))
    later = t > newest[:-1]
    if not later.all():
        t, value, frame = t[later], value[later], frame[later]
    joined = Readings(
        np.concatenate([old.t, t]),
        np.concatenate([old.value, value]),
        np.concatenate([old.frame, frame]),
        old.before,
    )
    return state._replace(readings={**state.readings, role: joined})


def take(
    state: State, latest: Array, dt: float, roles: Mapping[str, sampling.Role]
) -> tuple[State, list[Points]]:
    """Give out the grid points that some more frames complete.

    Args:
        state: from `put`, with all readings of these frames.
        latest: (n,) s, session time of the newest frame, at each frame.
        dt: the grid's step, s.
        roles: how each role is sampled.

    Example:
        >>> t = 0.06 * np.arange(4)
        >>> state = put(State(), "speed", t, 100.0 * t, np.arange(4))
        >>> state, points = take(state, t, 0.1, {"speed": sampling.Role(needed=True)})
        >>> points[0].t.tolist(), points[0].values["speed"].round(9).tolist()
        ([0.0, 0.1], [0.0, 10.0])
    """
    out = []
    # where the time jumps, the grid may go on behind the pause; in between it cannot fall so far back
    step = np.diff(latest, prepend=state.latest)
    jumps = np.flatnonzero(step > max(PAUSE - WAIT - 2 * dt, 0.0)).tolist()
    for begin, end in zip([0, *jumps], [*jumps, len(latest)], strict=True):
        if begin == end:
            continue
        index = state.next
        if latest[begin] - index * dt > PAUSE:
            index = int((latest[begin] - WAIT) / dt)
        t = np.arange(index, int(latest[end - 1] / dt) + 2) * dt
        t = t[t <= latest[end - 1]]
        given = _given(state, t, latest[begin:end], state.frames + begin, roles)
        n = int(np.searchsorted(given, state.frames + end))
        state = state._replace(next=index + n)
        if n:
            out.append(_points(state, t[:n], given[:n], roles))
    state = state._replace(frames=state.frames + len(latest))
    if latest.size:
        state = state._replace(latest=float(latest[-1]))
    return _trim(state, dt), out


def _given(state: State, t: Array, latest: Array, first: int, roles: Mapping[str, sampling.Role]) -> Ints:
    """Number of the frame with which each grid point is given out; too large where it is not among these."""
    waited = first + np.searchsorted(latest, t + WAIT)
    complete = np.full(len(t), first, np.int64)
    for role, how in roles.items():
        if not how.needed:
            continue
        readings = state.readings.get(role, _NONE)
        frames = np.append(readings.frame, np.iinfo(np.int64).max)
        complete = np.maximum(complete, frames[np.searchsorted(readings.t, t)])
    return np.maximum.accumulate(np.minimum(complete, waited))


def _points(state: State, t: Array, given: Ints, roles: Mapping[str, sampling.Role]) -> Points:
    values = {}
    begun = np.ones(len(t), bool)
    for role, how in roles.items():
        readings = state.readings.get(role, _NONE)
        # of the readings that had come, live keeps so many
        come = np.searchsorted(readings.frame, given, side="right")
        kept = np.maximum(come + readings.before - (KEPT + 1), 0) - readings.before
        after = np.minimum(np.searchsorted(readings.t, t, side="right"), come)
        there = (after > kept) & (after > 0)
        values[role] = _at(readings, t, after, come, there, how)
        if how.needed:
            oldest = np.maximum(kept, 0)
            begun &= (come > 0) & (np.append(readings.t, np.inf)[np.minimum(oldest, len(readings.t))] <= t)
    some = (t >= BEGIN) | begun
    if some.all():
        return Points(t, values)
    return Points(t[some], {role: value[some] for role, value in values.items()})


def _at(
    readings: Readings, t: Array, after: Ints, come: Ints, there: npt.NDArray[np.bool_], how: sampling.Role
) -> Array:
    """See `sampling._at`: the same numbers."""
    if not there.any():
        return np.full(len(t), NAN)
    n = len(readings.t)
    before = np.clip(after - 1, 0, n - 1)
    following = np.minimum(after, n - 1)
    before_t, value = readings.t[before], readings.value[before]
    last = after == come
    held = np.where(t - before_t <= how.stale, value, NAN)
    if how.needed and how.stale <= WAIT:
        held = np.where(last, NAN, held)
    if how.switch:
        out = held
    else:
        span = readings.t[following] - before_t
        with np.errstate(all="ignore"):
            between = value + (readings.value[following] - value) * ((t - before_t) / span)
        out = np.where(last, held, np.where(span > how.stale, NAN, between))
    return np.where(there, np.where(before_t == t, value, out), NAN)


def _trim(state: State, dt: float) -> State:
    """Forget what no later grid point can need: all but the last reading before the next one."""
    t = state.next * dt
    kept = {}
    for role, readings in state.readings.items():
        first = max(int(np.searchsorted(readings.t, t, side="right")) - 1, 0)
        kept[role] = Readings(
            readings.t[first:], readings.value[first:], readings.frame[first:], readings.before + first
        )
    return state._replace(readings=kept)
