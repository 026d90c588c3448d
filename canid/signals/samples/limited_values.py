"""Limits of a signal, found in its readings: an extreme that it reaches and leaves with a slope, again and again.

Between reaching and leaving, a signal without the limit would have gone further: by a quarter of slope times duration, were
it a parabola. A value that many readings share because it is coarse, or because it stands still, has no such slope.
Readings at a limit are not measured; one beyond it shows that there is none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.signals.samples.smoothing import MAX_REPORT_AGE_S
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.types import NAN, Array

# inputs of the models that a sensor or a logger may limit; the own speed stands still at a speed limiter's as well
WATCHED = ("gap", "range_rate", "lateral_offset")
# the role of which brief stays at a limit are bridged by another one, and the role that says of a sample that it is there
MARKED, AT_LIMIT = "range_rate", "at_limit"
# s over which a slope is taken, and after which a value that has left its extreme does not return to it
SLOPE_S = 0.5
# s; a signal that stays for longer at its extreme need not have turned once in between
MAX_STAY_S = 6.0
# resolutions by which a signal would have gone beyond its extreme; within one it is rounded to it
MIN_EXCESS = 1.5
# of each, that make a limit: visits, s; and the share of all visits to that value
MIN_VISITS, MIN_TIME_S, MIN_SHARE = 4, 2.0, 0.6
# of the value; smaller changes are the rounding of a conversion
ROUNDING = 1e-9


class Limited(NamedTuple):
    """A signal is limited."""

    role: str
    age: float  # s, since it was at its limit for the first time
    low: float  # in the role's unit; -inf: not limited on this side
    high: float


class Side(NamedTuple):
    """The largest value so far, of the signal or of its opposite."""

    value: float = -math.inf
    found: bool = False  # it is a limit
    begin: float = NAN  # s, of the visit; NaN: there is none
    end: float = NAN  # s, of the latest reading at the value
    slope: float = NAN  # 1/s, with which it was reached
    since: float = NAN  # s, of the first visit that speaks for a limit
    visits: int = 0  # that are over
    turned: int = 0  # of these, in which the signal would have gone further
    time: float = 0.0  # s, of these


class Watch(NamedTuple):
    """One signal."""

    recent: tuple[tuple[float, float], ...] = ()  # s and value, of the latest `SLOPE_S`
    resolution: float = math.inf  # smallest change
    low: Side = Side()  # of the opposite
    high: Side = Side()


State = Mapping[str, Watch]


class WithinLimits(NamedTuple):
    """A chunk without the readings at a limit."""

    decoded: Decoded  # with NaN in their place
    limits: tuple[tuple[int, Limited], ...]  # with the row from which on they are known
    marks: tuple[
        RoleReadings, ...
    ]  # of the role `AT_LIMIT`: 1 at a limit, 0 within; none where no limit is known


def init() -> State:
    """Return the state before the first reading."""
    return {}


def step(state: State, decoded: Decoded, t: Array) -> tuple[State, WithinLimits]:
    """Take a chunk.

    Args:
        state: from `init()` or the chunk before.
        decoded: the chunk's readings.
        t: (n,) s, of its frames.

    Example:
        >>> t = 0.1 * np.arange(400)
        >>> rate = RoleReadings("range_rate", np.arange(400), np.clip(1.2 * np.sin(t), -0.8, 0.8))
        >>> state, within = step(init(), Decoded((rate,), (), ()), t)
        >>> within.limits[0][1].low, within.limits[0][1].high, int(np.isnan(within.decoded.roles[0].value).sum())
        (-0.8, 0.8, 120)
    """
    if not any(readings.role in WATCHED for readings in decoded.roles):
        return state, WithinLimits(decoded, (), ())
    after, roles = dict(state), list(decoded.roles)
    limits, marks = list[tuple[int, Limited]](), list[RoleReadings]()
    for k, readings in enumerate(decoded.roles):
        role = readings.role
        if role not in WATCHED:
            continue
        after[role], limited, known = _chunk(after.get(role, Watch()), readings, t[readings.row])
        limits += limited
        hidden = known == 1.0
        if hidden.any():
            roles[k] = readings._replace(value=np.where(hidden, NAN, readings.value))
        if role == MARKED and (known == known).any():
            some = known == known
            marks.append(RoleReadings(AT_LIMIT, readings.row[some], known[some]))
    return after, WithinLimits(decoded._replace(roles=tuple(roles)), tuple(limits), tuple(marks))


def _chunk(watch: Watch, readings: RoleReadings, t: Array) -> tuple[Watch, list[tuple[int, Limited]], Array]:
    """Take a chunk of one signal; which readings are at a limit, 1 or 0: NaN where none is known."""
    limits, known = list[tuple[int, Limited]](), np.full(len(t), NAN)
    for k, (at, x) in enumerate(zip(t.tolist(), readings.value.tolist(), strict=True)):
        before = watch.low.found, watch.high.found
        watch = _reading(watch, at, x)
        low, high = watch.low.found, watch.high.found
        if (low and not before[0]) or (high and not before[1]):
            limits.append((int(readings.row[k]), _limited(readings.role, at, watch)))
        if low or high:
            known[k] = (low and x == -watch.low.value) or (high and x == watch.high.value)
    return watch, limits, known


def _limited(role: str, t: float, watch: Watch) -> Limited:
    low = -watch.low.value if watch.low.found else -math.inf
    high = watch.high.value if watch.high.found else math.inf
    since = min(side.since for side in (watch.low, watch.high) if side.found)
    return Limited(role, t - since, low, high)


def _reading(watch: Watch, t: float, x: float) -> Watch:
    recent, resolution, low, high = watch
    if x != x or (recent and not 0.0 <= t - recent[-1][0] <= MAX_REPORT_AGE_S):
        # what happened in a hole is not known
        low, high, recent = low._replace(begin=NAN), high._replace(begin=NAN), ()
        if x != x:
            return Watch((), resolution, low, high)
    if recent:
        change = abs(x - recent[-1][1])
        if ROUNDING * (1.0 + abs(x)) < change < resolution:
            resolution = change
        first = 0
        while first + 1 < len(recent) and recent[first + 1][0] <= t - SLOPE_S:
            first += 1
        recent = recent[first:]
    rise = x - recent[0][1] if recent else 0.0
    high = _side(high, t, x, rise, resolution)
    low = _side(low, t, -x, -rise, resolution)
    low, high = _found(low, high), _found(high, low)
    return Watch((*recent, (t, x)), resolution, low, high)


def _side(side: Side, t: float, x: float, rise: float, resolution: float) -> Side:
    """Take a reading; `rise` is its change over the last `SLOPE_S`."""
    if x > side.value:
        return Side(x, begin=t, end=t, slope=_slope(rise, SLOPE_S, resolution))
    if x == side.value:
        if side.begin == side.begin:
            return side._replace(end=t)
        return side._replace(begin=t, end=t, slope=_slope(rise, SLOPE_S, resolution))
    # comparisons with NaN are false
    if not (side.begin == side.begin and t - side.end >= SLOPE_S):
        return side
    slope = min(side.slope, _slope(side.value - x, t - side.end, resolution))
    stay = side.end - side.begin
    visits = side.visits + 1
    if not 0.25 * slope * min(stay, MAX_STAY_S) > MIN_EXCESS * resolution:
        return side._replace(begin=NAN, visits=visits)
    since = side.since if side.turned else side.begin
    turned, time = side.turned + 1, side.time + stay
    return side._replace(begin=NAN, since=since, visits=visits, turned=turned, time=time)


def _slope(rise: float, span: float, resolution: float) -> float:
    """The slope that a rise shows for certain: rounding adds up to one step."""
    return max(rise - resolution, 0.0) / span


def _found(side: Side, other: Side) -> Side:
    """Whether an extreme is a limit; visits to the same value on both sides count together."""
    # 0 is where a relative motion or an offset rests
    if side.found or not side.turned or side.value == 0.0:
        return side
    both = (side, other) if other.turned and side.value == other.value else (side,)
    turned, visits, time = (
        sum(column) for column in zip(*((s.turned, s.visits, s.time) for s in both), strict=True)
    )
    found = turned >= MIN_VISITS and time >= MIN_TIME_S and turned >= MIN_SHARE * visits
    return side._replace(found=found)
