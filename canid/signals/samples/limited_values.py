"""Limits of a signal, found in its readings: an extreme value that it reaches and leaves with a slope, again and again.

Between reaching and leaving, a signal without the limit would have gone further: by a quarter of slope times duration, were
it a parabola. A value that many readings share because it is coarse, or because it stands still, has no such slope. Where a
range rate is too coarse for that, the gap decides: it changes by more than the extreme, rounded, can mean.

Readings at a limit are not measured; one beyond it shows that there is none. Until a limit is known, a range rate that stays
at its extreme for longer than anywhere else may be at one: nothing is learned from it there. The first minutes, taken for
measured, make every gain too large.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from canid.signals.samples.reading_facts import Limited
from canid.signals.samples.smoothing import MAX_REPORT_AGE_S
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.findings import Flags
from canid.values.types import NAN, Array

# inputs of the models that a sensor or a logger may limit; the own speed stands still at a speed limiter's as well
WATCHED = ("gap", "range_rate", "lateral_offset")
# the role whose brief stays at a limit are bridged by another one, and the role that says of a sample that it is there
MARKED, AT_LIMIT = "range_rate", "at_limit"
# s over which a slope is taken, and after which a value that has left its extreme does not return to it
SLOPE_S = 0.5
# s; a signal that stays for longer at its extreme need not have turned once in between
MAX_STAY_S = 6.0
# resolutions by which a signal would have gone beyond its extreme; within one it is rounded to it
MIN_EXCESS = 1.5
# of each, that make a limit: visits, s; and the share of all visits to that value. In a coarse signal many are too short to
# show it: a smaller share is enough where there are more, and more readings at the value than at the next one
MIN_VISITS, MIN_TIME_S, MIN_SHARE = 4, 2.0, 0.6
MIN_COARSE_VISITS, MIN_COARSE_SHARE = 6, 0.25
# visits with which the gap decides; readings at the extreme, in multiples of those at the value next to it: far from its
# mean a signal that is not limited has fewer
MIN_GAP_VISITS, MIN_READINGS_RATIO = 6, 1.5
# m, of the gap's change in a visit: two reports with a noise of 0.25 m; standard deviations by which it must exceed what
# the extreme means, and times the extreme, as scales of radars are good to a few per cent
GAP_CHANGE_SD_M, GAP_SIGMAS, GAP_FACTOR = 0.35, 3.0, 1.1
# times the extreme; what changes the gap faster is another vehicle
MAX_GAP_FACTOR = 4.0
# readings in a row at an extreme that may be a limit; how much longer than elsewhere a signal stays there, as one that a
# radar holds repeats its values everywhere; and resolutions by which it would have gone beyond: of 90 signals with noise and
# no limit, in steps of 0.01 to 0.25 m/s, none reached 2, of those that are limited nine in ten 2 to 50
MIN_REPEATS, STAY_FACTOR, MIN_EXCESS_AT_ONCE = 3, 1.5, 2.0
# of the value; smaller changes are the rounding of a conversion
ROUNDING = 1e-9


class Visit(NamedTuple):
    """A stay at the extreme that is not over."""

    begin: float  # s
    end: float  # s, of the latest reading at the value
    slope: float  # 1/s, with which it was reached
    gap: float  # m, at its begin and end; NaN: not known
    gap_end: float


class Counts(NamedTuple):
    """Visits to an extreme that are over."""

    visits: int = 0
    turned: int = 0  # of these, in which the signal would have gone further
    time: float = 0.0  # s, of those
    stay: float = 0.0  # s, of the visits with a gap
    way: float = 0.0  # m, by which it has changed in them
    readings: int = 0  # at the extreme, and at the value next to it
    next_readings: int = 0


class Side(NamedTuple):
    """The largest value so far, of the signal or of its opposite."""

    value: float = -math.inf
    next_value: float = -math.inf  # the largest below it
    found: bool = False  # it is a limit
    since: float = NAN  # s, of the first visit
    visit: Visit | None = None
    counts: Counts = Counts()


class Watch(NamedTuple):
    """One signal."""

    recent: tuple[tuple[float, float], ...] = ()  # s and value, of the latest `SLOPE_S`
    resolution: float = math.inf  # smallest change
    low: Side = Side()  # of the opposite
    high: Side = Side()
    since: float = NAN  # s, of the first reading in a row at the latest value
    longest_stay: float = 0.0  # s, at one value that is no extreme
    suspected: bool = False  # it has stayed at an extreme that may be a limit


State = Mapping[str, Watch]


class WithinLimits(NamedTuple):
    """A chunk without the readings at a limit."""

    decoded: Decoded  # with NaN in their place
    limits: tuple[tuple[int, Limited], ...]  # with the row from which on they are known
    # of the role `AT_LIMIT`: 1 at a limit or at what may be one, 0 within; none before the first
    marks: tuple[RoleReadings, ...]


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
        >>> within.limits[0][1].low, within.limits[0][1].high, bool(np.isnan(within.decoded.roles[0].value).any())
        (-0.8, 0.8, True)
    """
    if not any(readings.role in WATCHED for readings in decoded.roles):
        return state, WithinLimits(decoded, (), ())
    after, roles = dict(state), list(decoded.roles)
    limits, marks = list[tuple[int, Limited]](), list[RoleReadings]()
    for k, readings in enumerate(decoded.roles):
        role = readings.role
        if role not in WATCHED:
            continue
        gaps = _gaps(state, decoded, readings) if role == MARKED else np.full(len(readings.row), NAN)
        after[role], limited, hidden, mark = _chunk(after.get(role, Watch()), readings, t[readings.row], gaps)
        limits += limited
        some = mark == mark
        if hidden.any():
            roles[k] = readings._replace(value=np.where(hidden, NAN, readings.value))
        if role == MARKED and some.any():
            marks.append(RoleReadings(AT_LIMIT, readings.row[some], mark[some]))
    return after, WithinLimits(decoded._replace(roles=tuple(roles)), tuple(limits), tuple(marks))


def _gaps(state: State, decoded: Decoded, readings: RoleReadings) -> Array:
    """The latest gap at each of these readings, m."""
    before = state["gap"].recent[-1][1] if "gap" in state and state["gap"].recent else NAN
    gap = next((each for each in decoded.roles if each.role == "gap"), None)
    if gap is None:
        return np.full(len(readings.row), before)
    come = np.searchsorted(gap.row, readings.row, side="right")
    return np.concatenate([[before], gap.value])[come]


def _chunk(
    watch: Watch, readings: RoleReadings, t: Array, gaps: Array
) -> tuple[Watch, list[tuple[int, Limited]], Flags, Array]:
    """Take a chunk of one signal; which readings are at a limit, and their marks: NaN before the first."""
    limits, mark = list[tuple[int, Limited]](), np.full(len(t), NAN)
    hidden = np.zeros(len(t), dtype=bool)
    columns = zip(t.tolist(), readings.value.tolist(), gaps.tolist(), strict=True)
    for k, (at, x, gap) in enumerate(columns):
        before = watch.low.found, watch.high.found
        watch = _reading(watch, at, x, gap)
        low, high = watch.low.found, watch.high.found
        if (low and not before[0]) or (high and not before[1]):
            limits.append((int(readings.row[k]), _limited(readings.role, at, watch)))
        if low or high or watch.suspected:
            hidden[k] = (low and x == -watch.low.value) or (high and x == watch.high.value)
            mark[k] = hidden[k] or _may_be_limited(watch)
    return watch, limits, hidden, mark


def _limited(role: str, t: float, watch: Watch) -> Limited:
    low = -watch.low.value if watch.low.found else -math.inf
    high = watch.high.value if watch.high.found else math.inf
    since = min(side.since for side in (watch.low, watch.high) if side.found)
    return Limited(role, t - since, low, high)


def _reading(watch: Watch, t: float, x: float, gap: float) -> Watch:
    recent, resolution, low, high, since, longest, suspected = watch
    if x != x or (recent and not 0.0 <= t - recent[-1][0] <= MAX_REPORT_AGE_S):
        # what happened in a hole is not known
        low, high, recent = low._replace(visit=None), high._replace(visit=None), ()
        if x != x:
            return Watch((), resolution, low, high, NAN, longest, suspected)
    latest = recent[-1] if recent else (t, NAN)
    if recent:
        change = abs(x - recent[-1][1])
        if ROUNDING * (1.0 + abs(x)) < change < resolution:
            resolution = change
        first = 0
        while first + 1 < len(recent) and recent[first + 1][0] <= t - SLOPE_S:
            first += 1
        recent = recent[first:]
    rise = x - recent[0][1] if recent else 0.0
    if x >= high.next_value or high.visit is not None:
        high = _side(high, t, x, rise, resolution, gap)
    if -x >= low.next_value or low.visit is not None:
        low = _side(low, t, -x, -rise, resolution, -gap)
    if low is not watch.low or high is not watch.high or resolution != watch.resolution:
        low, high = _judged(low, high, resolution), _judged(high, low, resolution)
    if x != latest[1]:
        if -low.value < latest[1] < high.value:
            longest = max(longest, latest[0] - since)
        since = t
    after = Watch((*recent, (t, x)), resolution, low, high, since, longest, suspected)
    return after if suspected or not _may_be_limited(after) else after._replace(suspected=True)


def _may_be_limited(watch: Watch) -> bool:
    """Whether the latest reading stands at an extreme as at a limit: for longer than elsewhere, and reached with a slope."""
    if not watch.recent:
        return False
    t, x = watch.recent[-1]
    side = watch.high if x == watch.high.value else watch.low
    stay = t - watch.since
    if side.visit is None or x == 0.0 or not stay > STAY_FACTOR * watch.longest_stay:
        return False
    return (
        x in (-watch.low.value, watch.high.value)
        and len(watch.recent) >= MIN_REPEATS
        and all(value == x for _, value in watch.recent[-MIN_REPEATS:])
        and 0.25 * side.visit.slope * min(stay, MAX_STAY_S) > MIN_EXCESS_AT_ONCE * watch.resolution
    )


def _side(side: Side, t: float, x: float, rise: float, resolution: float, gap: float) -> Side:
    """Take a reading; `rise` is its change over the last `SLOPE_S`, `gap` falls where x is of the opposite."""
    visit, counts = side.visit, side.counts
    if x > side.value:
        visit = Visit(t, t, _slope(rise, SLOPE_S, resolution), gap, gap)
        return Side(x, side.value, False, t, visit, Counts(readings=1, next_readings=counts.readings))
    if x == side.value:
        visit = Visit(t, t, _slope(rise, SLOPE_S, resolution), gap, gap) if visit is None else visit
        visit = visit._replace(end=t, gap_end=gap)
        return side._replace(visit=visit, counts=counts._replace(readings=counts.readings + 1))
    if x > side.next_value:
        side = side._replace(next_value=x, counts=counts._replace(next_readings=1))
    elif x == side.next_value:
        side = side._replace(counts=counts._replace(next_readings=counts.next_readings + 1))
    if visit is None or t - visit.end < SLOPE_S:
        return side
    return side._replace(visit=None, counts=_ended(side, visit, t, x, resolution))


def _ended(side: Side, visit: Visit, t: float, x: float, resolution: float) -> Counts:
    """Count a visit that is over, as x at t is below the extreme."""
    counts, stay = side.counts, visit.end - visit.begin
    slope = min(visit.slope, _slope(side.value - x, t - visit.end, resolution))
    counts = counts._replace(visits=counts.visits + 1)
    if 0.25 * slope * min(stay, MAX_STAY_S) > MIN_EXCESS * resolution:
        counts = counts._replace(turned=counts.turned + 1, time=counts.time + stay)
    way = visit.gap_end - visit.gap
    # comparisons with NaN are false
    if stay > 0.0 and abs(way) <= MAX_GAP_FACTOR * (abs(side.value) * stay + GAP_CHANGE_SD_M):
        counts = counts._replace(stay=counts.stay + stay, way=counts.way + way)
    return counts


def _slope(rise: float, span: float, resolution: float) -> float:
    """The slope that a rise shows for certain: rounding adds up to one step."""
    return max(rise - resolution, 0.0) / span


def _judged(side: Side, other: Side, resolution: float) -> Side:
    """Whether an extreme is a limit; visits to the same value on both sides count together."""
    counts = side.counts
    # 0 is where a relative motion or an offset rests
    if side.found or not counts.visits or side.value == 0.0:
        return side
    if other.counts.visits and abs(side.value - other.value) <= ROUNDING * (1.0 + abs(side.value)):
        counts = Counts._make(a + b for a, b in zip(counts, other.counts, strict=True))
    many = counts.readings >= MIN_READINGS_RATIO * counts.next_readings
    turned = counts.turned >= max(MIN_VISITS, MIN_SHARE * counts.visits)
    turned |= many and counts.turned >= max(MIN_COARSE_VISITS, MIN_COARSE_SHARE * counts.visits)
    limited = (turned and counts.time >= MIN_TIME_S) or (many and _exceeded(side.value, counts, resolution))
    return side._replace(found=True) if limited else side


def _exceeded(value: float, counts: Counts, resolution: float) -> bool:
    """Whether the gap changes by more than a range rate at its extreme means."""
    if counts.visits < MIN_GAP_VISITS or counts.stay < MIN_TIME_S:
        return False
    error = GAP_SIGMAS * GAP_CHANGE_SD_M * math.sqrt(counts.visits)
    most = max(GAP_FACTOR * value, value + 0.5 * resolution) * counts.stay
    return value > resolution and counts.way > most + error
