"""Sampling on a uniform grid: the values of all roles at its points, by linear interpolation between readings.

Holding the last value of a 20 Hz radar would put 20 ms of dead time into the driver. Switches are held.

A grid point is complete with the frame that brings the last reading that it needs, and has the value of the readings
that had come by then, however many frames are processed together: each reading carries the number of its frame.

With `Instants` the grid consists of the instants at which one role is updated, and that role has its value there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.signals.samples import local_polynomial, update_instants
from canid.signals.samples.local_polynomial import Fitted
from canid.signals.samples.update_instants import Instants
from canid.values.types import NAN, Array

# s; how long a grid point waits for the reading after it: the lag of the smoothing and what is smoothed together, 0.5 s
# that a target may be silent before it counts as lost and what was being smoothed is given out, and two reports of a
# 10 Hz radar
MAX_WAIT_S = 2.4
# readings kept per role: MAX_WAIT_S at 200 Hz
READINGS_KEPT = 480
# readings of a role from which on it is worth while to drop what is no longer needed
MIN_TRIMMED = 256
# s; grid points before the first reading of every needed role are left out, at the begin and behind a pause, but for no
# longer than this: a signal that is still missing then is missing
MAX_START_S = 1.0
# s; times are whole nanoseconds: half of one keeps the point at a block's start on its side
ROUNDING_S = 5e-10
# s; without a frame for longer than this the samples end, and begin anew behind the pause as at the drive's begin
MAX_PAUSE_S = 10.0

Ints = npt.NDArray[np.int64]


class Role(NamedTuple):
    """How a role is sampled."""

    switch: bool = False  # held, not interpolated
    stale: float = 0.5  # s; older than this is NaN
    needed: bool = False  # a grid point waits for it
    updated: bool = False  # its instants are the grid
    smooth: float = 0.0  # s, half the width of a local parabola through its readings; 0: none
    widest: float = 0.0  # s, likewise where they are noisy


class Readings(NamedTuple):
    """One role's readings, times ascending."""

    t: Array  # (n,) s
    value: Array  # (n,)
    frame: Ints  # (n,) number of the frame that brought it


class Kept(NamedTuple):
    """One role's readings that a later grid point may need, and those that came since."""

    joined: Readings
    parts: tuple[Readings, ...] = ()  # not joined yet: most chunks complete no grid point
    dropped: int = 0  # readings before `joined`
    newest: float = -np.inf  # s, time of the last reading


# Instants that a grid follows, by blocks; None: k dt.
Grid = tuple[Instants, ...] | None
# grid points that are left out where the instants move, so that no sample's history spans two senders' clocks
LEFT_OUT = 2


class State(NamedTuple):
    """Readings not yet used up, and the next grid point."""

    kept: Mapping[str, Kept] = {}
    next: int = 0  # index of the next grid point
    frames: int = 0  # that have come
    latest: float = 0.0  # s, session time of the newest
    begin: float = 0.0  # s, session time of the first frame behind the latest pause


class Points(NamedTuple):
    """Grid points."""

    t: Array  # (m,) s
    frame: Ints  # (m,) number of the frame that completed each
    values: dict[str, Array]  # role -> (m,); NaN = not measured then
    # role -> (m,) of a value that several readings make, by their scatter; NaN = not known
    variances: dict[str, Array]


_NONE = Readings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))
_NEVER = np.iinfo(np.int64).max


def init() -> State:
    """Return the state before the first reading."""
    return State()


def put(state: State, readings: Mapping[str, Readings]) -> State:
    """Add readings by role, in the order in which they came; one not later than the one before is ignored.

    Example:
        >>> speed = Readings(np.array([0.0, 0.1, 0.1]), np.array([5.0, 6.0, 7.0]), np.arange(3))
        >>> state = put(init(), {"speed": speed})
        >>> state.kept["speed"].parts[0].value.tolist()
        [5.0, 6.0]
    """
    kept = dict(state.kept)
    ordered: dict[tuple[int, float], npt.NDArray[np.bool_] | None] = {}
    for role, part in readings.items():
        old = kept.get(role) or Kept(_NONE)
        # roles of one message share their times
        key = id(part.t), old.newest
        if key not in ordered:
            ordered[key] = _later(part.t, old.newest)
        later = ordered[key]
        if later is not None:
            part = Readings(part.t[later], part.value[later], part.frame[later])
        if part.t.size:
            kept[role] = old._replace(parts=(*old.parts, part), newest=float(part.t[-1]))
    return state._replace(kept=kept)


def pauses(state: State, latest: Array) -> Ints:
    """Which of some more frames come behind a pause; the first of a part of a log does, too.

    Args:
        state: before them.
        latest: (n,) s, session time of the newest frame, at each frame.

    Example:
        >>> pauses(init(), np.array([0.0, 0.1, 15.0]))
        array([2])
    """
    return np.flatnonzero(np.diff(latest, prepend=state.latest) > MAX_PAUSE_S)


def _later(t: Array, newest: float) -> npt.NDArray[np.bool_] | None:
    """Which times are later than all before them; None: all are."""
    later = np.empty(len(t), bool)
    later[:1] = t[:1] > newest
    later[1:] = t[1:] > t[:-1]
    if later.all():
        return None
    return t > np.maximum.accumulate(np.concatenate([[newest], t]))[:-1]


def take(
    state: State, latest: Array, dt: float, roles: Mapping[str, Role], grid: Grid = None
) -> tuple[State, list[Points]]:
    """Take the grid points that some more frames complete.

    Args:
        state: from `put`, with all readings of these frames.
        latest: (n,) s, session time of the newest frame, at each frame.
        dt: the grid's step, s.
        roles: how each role is sampled.
        grid: the instants that the grid follows; before the first of them there is none. None: k dt.

    Returns:
        the next state and the points, in parts that ascend in time.

    Example:
        >>> t = 0.06 * np.arange(4)
        >>> state = put(init(), {"speed": Readings(t, 100.0 * t, np.arange(4))})
        >>> state, points = take(state, t, 0.1, {"speed": Role(needed=True)})
        >>> points[0].t.tolist(), points[0].values["speed"].round(9).tolist()
        ([0.0, 0.1], [0.0, 10.0])
    """
    if not latest.size:
        return state, []
    after = state.frames + len(latest), float(latest[-1])
    if not _complete(state, after[1], dt, roles, grid):
        return state._replace(frames=after[0], latest=after[1]), []
    state = state._replace(kept={role: _joined(kept) for role, kept in state.kept.items()})
    out = []
    jumps = pauses(state, latest).tolist()
    ends = [*jumps, len(latest)]
    for part, (begin, end) in enumerate(zip([0, *jumps], ends, strict=True)):
        if part:
            state = state._replace(
                next=math.ceil(latest[begin] / dt - ROUNDING_S), begin=float(latest[begin])
            )
        newest = float(latest[end - 1]) if end else state.latest
        k = np.arange(state.next, int(newest / dt) + 2)
        k, t = _points_of(k, dt, grid)
        k, t = k[t <= newest], t[t <= newest]
        frame = _completed_by(state, t, latest[begin:end], state.frames + begin, roles, dt)
        if end < len(latest):
            # no reading after it will come
            frame = np.minimum(frame, state.frames + end)
            n = len(frame)
        else:
            n = int(np.searchsorted(frame, state.frames + end))
        if n:
            state = state._replace(next=int(k[n - 1]) + 1)
            with np.errstate(all="ignore"):
                kinds = _kinds(np.multiply(k[:n], dt, dtype=np.float64), grid)
                out.append(_points(state, t[:n], frame[:n], roles, kinds, dt))
    return _trimmed(state, dt, roles)._replace(frames=after[0], latest=after[1]), out


def _points_of(k: Ints, dt: float, grid: Grid) -> tuple[Ints, Array]:
    """Grid points among those numbered k, and their times in s."""
    if grid is None:
        return k, np.multiply(k, dt, dtype=np.float64)
    block = np.searchsorted(_starts(grid), k * dt + ROUNDING_S, side="right") - 1
    phase = np.array([0.0, *(instants.phase for instants in grid)], np.float64)[block + 1]
    # the first points of a block whose instants are others
    since = np.round(k - np.array([0.0, *_starts(grid)])[block + 1] / dt)
    fresh = np.array([True, *(instants.fresh for instants in grid)])[block + 1]
    some = (block >= 0) & ~(fresh & (since < LEFT_OUT))
    return k[some], np.add(k * dt, phase, dtype=np.float64)[some]


def _starts(grid: tuple[Instants, ...]) -> list[float]:
    return [instants.start for instants in grid]


def _kinds(t: Array, grid: Grid) -> list[str]:
    """How the updated role has its value at grid points of these nominal times."""
    if grid is None:
        return []
    kinds = [instants.kind for instants in grid]
    return [kinds[b] for b in np.searchsorted(_starts(grid), t + ROUNDING_S, side="right") - 1]


def _complete(state: State, latest: float, dt: float, roles: Mapping[str, Role], grid: Grid) -> bool:
    """Whether the next grid point may be complete at time `latest` [s]."""
    # instants are within half a step of k dt
    t = (state.next - 0.5 * (grid is not None)) * dt
    if latest >= t + MAX_WAIT_S:
        return True
    return latest >= t and all(
        role in state.kept and state.kept[role].newest >= t for role, how in roles.items() if how.needed
    )


def _joined(kept: Kept) -> Kept:
    if not kept.parts:
        return kept
    columns = zip(kept.joined, *kept.parts, strict=True)
    return kept._replace(joined=Readings(*(np.concatenate(column) for column in columns)), parts=())


def _completed_by(
    state: State, t: Array, latest: Array, first: int, roles: Mapping[str, Role], dt: float
) -> Ints:
    """Number of the frame with which each grid point is complete; too large where it is not among these."""
    waited = first + np.searchsorted(latest, t + MAX_WAIT_S)
    complete = np.full(len(t), first, np.int64)
    for role, how in roles.items():
        if not how.needed:
            continue
        readings = state.kept[role].joined if role in state.kept else _NONE
        frames = np.append(readings.frame, _NEVER)
        ahead = dt if how.updated else how.smooth
        complete = np.maximum(complete, frames[np.searchsorted(readings.t, t + ahead)])
    return np.maximum.accumulate(np.minimum(complete, waited))


def _points(
    state: State, t: Array, frame: Ints, roles: Mapping[str, Role], kinds: list[str], dt: float
) -> Points:
    values, variances = {}, {}
    begun = np.ones(len(t), bool)
    for role, how in roles.items():
        kept = state.kept.get(role)
        if kept is None:
            values[role] = np.full(len(t), NAN)
            begun &= not how.needed
            continue
        readings = kept.joined
        # of the readings that had come, so many are kept
        come = np.searchsorted(readings.frame, frame, side="right")
        first = np.maximum(come + kept.dropped - (READINGS_KEPT + 1), 0) - kept.dropped
        after = np.minimum(np.searchsorted(readings.t, t, side="right"), come)
        values[role] = _values(readings, t, after, come, (after > first) & (after > 0), how)
        if how.updated and kinds:
            values[role], variances[role] = _at_instants(readings, t, come, values[role], kinds, dt)
        elif how.smooth:
            values[role], variances[role] = _smooth(readings, t, come, values[role], how)
        if how.needed:
            of_part = np.searchsorted(readings.t, state.begin)
            oldest = np.minimum(np.maximum(first, of_part), len(readings.t))
            begun &= (come > of_part) & (np.append(readings.t, np.inf)[oldest] <= t)
    some = (t >= state.begin + MAX_START_S) | begun
    if some.all():
        return Points(t, frame, values, variances)
    return Points(
        t[some],
        frame[some],
        *({role: x[some] for role, x in by_role.items()} for by_role in (values, variances)),
    )


def _values(
    readings: Readings, t: Array, after: Ints, come: Ints, there: npt.NDArray[np.bool_], how: Role
) -> Array:
    """Values of a role at t: interpolated, or held where nothing later came; NaN where too old.

    Args:
        readings: of the role.
        t: (m,) s.
        after: (m,) number of readings up to t.
        come: (m,) number of readings that had come.
        there: (m,) whether one of those up to t is kept.
        how: the role is sampled.
    """
    before = after - 1
    before_t, value = readings.t[before], readings.value[before]
    last = after == come
    known = t - before_t <= how.stale
    if how.needed and how.stale <= MAX_WAIT_S:
        # waited for longer than it may be old: this is the edge of a hole
        known &= ~last
    if not how.switch:
        following = np.minimum(after, len(readings.t) - 1)
        span = readings.t[following] - before_t
        between = value + (readings.value[following] - value) * ((t - before_t) / span)
        known = np.where(last, known, span <= how.stale)
    exact = before_t == t
    if not how.switch:
        value = np.where(last | exact, value, between)
    return np.where(there & (known | exact), value, NAN)


def _at_instants(
    readings: Readings, t: Array, come: Ints, joined: Array, kinds: list[str], dt: float
) -> tuple[Array, Array]:
    """Values (m,) of the role whose instants the grid follows, and variances; joined where they are not shown."""

    def at(i: int, near: slice) -> Fitted:
        if kinds[i] == "none":
            return Fitted()
        times, values = readings.t[near], readings.value[near]
        return update_instants.value_at(times, values, float(t[i]), kinds[i], dt)

    return _each(readings, t, come, joined, dt, at)


def _smooth(readings: Readings, t: Array, come: Ints, joined: Array, how: Role) -> tuple[Array, Array]:
    """Values (m,) of a smooth role, and variances; joined by lines where its readings are too few."""
    reach = max(how.smooth, how.widest)
    squares = local_polynomial.noise(readings.t, readings.value).tolist() if how.widest else []

    def at(i: int, near: slice) -> Fitted:
        x, y = (readings.t[near] - t[i]).tolist(), readings.value[near].tolist()
        return local_polynomial.smooth(x, y, squares[near], how.smooth)

    return _each(readings, t, come, joined, reach, at)


def _each(
    readings: Readings,
    t: Array,
    come: Ints,
    joined: Array,
    reach: float,
    fitted: Callable[[int, slice], Fitted],
) -> tuple[Array, Array]:
    """Fit the readings within `reach` s of each point that was measured, as many as had come."""
    out, variance = joined.copy(), np.full(len(t), NAN)
    low = np.searchsorted(readings.t, t - reach)
    high = np.minimum(np.searchsorted(readings.t, t + reach), come)
    for i, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        if joined[i] == joined[i]:
            fit = fitted(i, slice(a, b))
            out[i] = fit.value if fit.value == fit.value else joined[i]
            variance[i] = fit.variance
    return out, variance


def _trimmed(state: State, dt: float, roles: Mapping[str, Role]) -> State:
    """Drop what no later grid point can need: all but the last reading before the next one."""
    kept = dict(state.kept)
    for role, old in state.kept.items():
        if len(old.joined.t) < MIN_TRIMMED:
            continue
        needed_from = state.next * dt
        if any(how.updated for how in roles.values()):
            # instants are within half a step of k dt
            needed_from -= 0.5 * dt + dt
        needed_from -= max((max(how.smooth, how.widest) for how in roles.values()), default=0.0)
        t, value, frame = old.joined
        first = max(int(np.searchsorted(t, needed_from, side="right")) - 1, 0)
        rest = Readings(t[first:], value[first:], frame[first:])
        kept[role] = old._replace(joined=rest, dropped=old.dropped + first)
    return state._replace(kept=kept)
