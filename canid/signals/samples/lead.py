"""Choice of the lead (the vehicle ahead): from signals, or among radar tracks; its gap and range rate are smoothed.

A track is chosen that is in the own path, nearest and continuous. A change of target is an event and the start of a
new history, never a jump in range rate.
"""

from __future__ import annotations

from math import exp, inf
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.signals.samples import own_speed, smoothing
from canid.signals.samples.report_noise import Noise
from canid.signals.samples.smoothing import Age
from canid.signals.vehicle import Vehicle
from canid.values.types import NAN, Array, Event, Reading, TrackReading

# s; a track counts only while it reports: three missed reports at 10 Hz. Shorter than the bridge of the smoothing,
# so that the same vehicle under another number is still recognised
TRACK_TIMEOUT_S = 0.3
# s; a track must have been in the path for this long before it is followed: reflections last a report or two
MIN_PERSISTENCE_S = 0.25
# a followed target may move this much further out than a new one may come in, before it is let go
FOLLOWED_PATH_FACTOR = 1.4
# m; another track must be this much nearer to be another vehicle in between, not the other end of the same one
MIN_DISTANCE_STEP_M = 4.0
# m/s; slower objects over ground are the roadside, unless the own vehicle crawls
MIN_GROUND_SPEED = 2.0
# m/s; below this own speed the yaw rate says nothing about the path's curve
MIN_CURVE_SPEED = 5.0
# s; the road bends for longer than a lane change swings (its yaw rate reverses after 2 to 3 s)
YAW_RATE_TIME_CONSTANT_S = 2.0

# the lead as the radar reported it, as signals of their own: smoothing makes gap and range rate agree with each other,
# and a frozen report move, so what is wrong with the radar itself can be seen in these alone
REPORTED = {"gap": "gap_reported", "range_rate": "range_rate_reported"}
# of a reading that says that a pause is over, in which no frame came
PAUSE = "pause"


class Settings(NamedTuple):
    """What the vehicle file says about the lead."""

    from_tracks: bool = False
    in_path: float = 1.8  # m; half a lane of 3.6 m
    # tracks say where they are to the side; without, the nearest that moves is the lead
    sideways: bool = True
    noise: Noise = Noise()
    # s; older than this is not measured any more
    age: Age = Age()  # of gap and range rate
    silent: float = TRACK_TIMEOUT_S  # of a track's report
    valid: float | None = None  # of `lead_valid`; None: it is not mapped, and every report is valid
    speed: float = 0.5
    yaw_rate: float = 0.5


def settings_of(vehicle: Vehicle) -> Settings:
    """What a vehicle file says about the lead.

    Example:
        >>> from canid.signals.vehicle import read_vehicle
        >>> settings_of(read_vehicle("generic")).valid
        1.0
    """
    config, roles = vehicle.lead, vehicle.roles

    def stale(role: str, otherwise: float) -> float:
        return roles[role].stale if role in roles else otherwise

    tracks = config.tracks is not None
    usual = Age() if config.stale is None else Age(config.stale, config.stale)
    return Settings(
        from_tracks=tracks,
        in_path=config.in_path,
        sideways=not config.tracks or any(track.has_side for track in config.tracks),
        noise=stated_noise(vehicle),
        # a rate that is made of the gap is as old as that is
        age=usual
        if tracks
        else Age(
            stale("gap", usual.gap),
            inf if config.rate_from_gap else stale("range_rate", usual.range_rate),
        ),
        silent=TRACK_TIMEOUT_S if config.stale is None else config.stale,
        valid=roles["lead_valid"].stale if "lead_valid" in roles else None,
        speed=stale("speed", Settings().speed),
        yaw_rate=stale("yaw_rate", Settings().yaw_rate),
    )


def stated_noise(vehicle: Vehicle) -> Noise:
    """Return the radar's noise as the vehicle file states it; NaN where it does not."""
    gap, rate = vehicle.lead.gap_noise, vehicle.lead.range_rate_noise
    return Noise(NAN if gap is None else gap, NAN if rate is None else rate)


class Track(NamedTuple):
    """A track's latest report, and since when it has been a vehicle in our path."""

    t: float
    distance: float
    rate: float
    since: float  # s; NaN: it is none


# what is said of a lead that is not there
NO_LEAD = {"gap": NAN, "range_rate": NAN, "lead_speed": NAN, "lead_valid": 0.0}
_NONE = np.zeros(0, np.int64)
# no report is being collected
NO_REPORT = (NAN, NAN, NAN)


class State(NamedTuple):
    """What the next reading's meaning depends on."""

    tracks: dict[int, Track]
    target: int = -1  # track number; -1: none
    serial: int = 0  # of the target: grows by one with every change
    pending: tuple[float, float, float] = NO_REPORT  # t, gap, range rate of the report being collected
    valid: float = NAN  # lead_valid, where it is a signal; NaN: not known
    valid_at: float = NAN  # s, of its last reading; NaN: none has come
    yaw_rate: float = 0.0  # rad/s, own, left positive, averaged over YAW_RATE_TIME_CONSTANT_S
    yaw_at: float = NAN  # s, of its last reading
    smooth: smoothing.State = smoothing.State()
    own: own_speed.State = own_speed.State()
    given: float = -1.0  # s, of the last smoothed report


Out = list[Reading | Event]


def init() -> State:
    """Return the state before the first reading."""
    return State(tracks={})


def step(state: State, reading: Reading | TrackReading, settings: Settings) -> tuple[State, Out]:
    """Update the lead with one reading; every other role passes unchanged.

    Returns:
        the next state, and readings of `gap`, `range_rate`, `lead_valid` and `target` (the target's serial number)
        in the place of those that came, late by `smoothing.LEAD_LAG_S`, and of `lead_speed` where the own speed
        is known.

    Example:
        >>> state, out = step(init(), Reading(0.0, "speed", 20.0), Settings())
        >>> out
        [Reading(t=0.0, role='speed', value=20.0)]
    """
    if isinstance(reading, TrackReading):
        return _track(state, reading, settings)
    out: Out = []
    if not settings.from_tracks and reading.t > state.pending[0]:
        state, out = _collected(state, settings)
    role, value = reading.role, reading.value
    if role in ("gap", "range_rate") and not settings.from_tracks:
        t, gap, rate = state.pending
        if t != reading.t:
            gap = rate = NAN
        pending = (reading.t, value, rate) if role == "gap" else (reading.t, gap, value)
        # written out here and below: `_replace` takes four times as long, and an hour has half a million readings
        tracks, target, serial, _, valid, valid_at, yaw_rate, yaw_at, smooth, known_own, given = state
        return State(
            tracks, target, serial, pending, valid, valid_at, yaw_rate, yaw_at, smooth, known_own, given
        ), out
    if role == "lead_valid" and not settings.from_tracks:
        tracks, target, serial, pending, _, _, yaw_rate, yaw_at, smooth, known_own, given = state
        return State(
            tracks, target, serial, pending, value, reading.t, yaw_rate, yaw_at, smooth, known_own, given
        ), out
    if role == "speed":
        own_state = own_speed.put(state.own, reading.t, value)
        history = state.smooth.history
        if history and reading.t - history[-1].t > smoothing.MAX_REPORT_AGE_S:
            smooth, points = smoothing.early(state.smooth, reading.t, settings.age)
            out += _readings(points, state.serial)
            state = state._replace(smooth=smooth, given=points[-1].t if points else state.given)
        if own_state is not state.own:
            tracks, target, serial, pending, valid, valid_at, yaw_rate, yaw_at, smooth, _, given = state
            state = State(
                tracks, target, serial, pending, valid, valid_at, yaw_rate, yaw_at, smooth, own_state, given
            )
    elif role == PAUSE:
        return _paused(state, settings, out)
    elif role == "yaw_rate" and value == value:
        passed = reading.t - state.yaw_at
        weight = 1.0 - exp(-passed / YAW_RATE_TIME_CONSTANT_S) if passed == passed else 1.0
        yaw_rate = state.yaw_rate + weight * (value - state.yaw_rate)
        state = state._replace(yaw_rate=yaw_rate, yaw_at=reading.t)
    out.append(reading)
    return state, out


def _collected(state: State, settings: Settings) -> tuple[State, Out]:
    """One frame's gap and range rate are together: smooth them."""
    t, gap, rate = state.pending
    valid = validity(state, t, settings)
    if valid != valid:  # nobody knows whether these numbers mean anything
        gap = rate = NAN
    history = state.smooth.history
    if valid == 0.0 or (gap != gap and not (history and t - history[-1].gap_at <= settings.age.bridge)):
        return _lost(state, t, settings, valid if valid != valid else 0.0)
    return _follow(state, t, gap, rate, settings)


def validity(state: State, t: float, settings: Settings) -> float:
    """Whether reports at t [s] are of a vehicle: 0.0 says that they are not, NaN that it is not known (any more)."""
    if state.valid_at != state.valid_at:
        return 1.0 if settings.valid is None else NAN
    if settings.valid is not None and t - state.valid_at > settings.valid:
        return NAN
    return state.valid


def _readings(points: list[smoothing.Smoothed], serial: int) -> Out:
    out: Out = []
    for t, gap, rate, speed in points:
        out += [Reading(t, "gap", gap), Reading(t, "range_rate", rate), Reading(t, "lead_speed", speed)]
        out += [Reading(t, "lead_valid", 1.0), Reading(t, "target", float(serial))]
    return out


def _nothing(t: float) -> Out:
    """Nothing is known between the reports of two vehicles: no line joins them."""
    return [Reading(t, role, NAN) for role in ("gap", "range_rate", "lead_speed", *REPORTED.values())]


def _lost(state: State, t: float, settings: Settings, valid: float = 0.0) -> tuple[State, Out]:
    """No target, or none that is known: say so once per report, and give out what was still being smoothed."""
    points = smoothing.flush(state.smooth, settings.age)
    out = _readings(points, state.serial)
    given = points[-1].t if points else state.given
    if state.smooth.history:
        out.append(Event(t, "lead_lost", f"{t:.1f} s: the vehicle ahead is gone"))
        if settings.from_tracks and given < t:
            given = 0.5 * (given + t)
            out += _nothing(given)
    # without a target there is nothing to smooth: said with the same lag, to keep each role's times in order
    at = t - smoothing.LEAD_LAG_S
    if at > given:
        given = at
        out += [Reading(at, role, value) for role, value in NO_LEAD.items()]
        out[-1] = Reading(at, "lead_valid", valid)
    smooth = smoothing.fresh(state.smooth)
    return state._replace(pending=NO_REPORT, smooth=smooth, target=-1, given=given), out


def _paused(state: State, settings: Settings, out: Out) -> tuple[State, Out]:
    """Give out what was being smoothed; behind the pause all begins anew but the numbers of the targets."""
    points = smoothing.flush(state.smooth, settings.age)
    out += _readings(points, state.serial)
    given = points[-1].t if points else state.given
    return State({}, serial=state.serial, smooth=smoothing.fresh(state.smooth), given=given), out


def _follow(state: State, t: float, gap: float, rate: float, settings: Settings) -> tuple[State, Out]:
    fresh = not state.smooth.history
    own_state, speed = own_speed.at(state.own, t, settings.speed)
    smooth, points, changed = smoothing.step(state.smooth, t, gap, rate, settings.noise, settings.age, speed)
    out = _readings(points, state.serial)
    given = points[-1].t if points else state.given
    serial = state.serial
    if changed or (fresh and smooth.history):
        serial += 1
        if serial > 1 or changed:
            says = f"{t:.1f} s: another vehicle ahead, at {gap:.0f} m"
            out.append(Event(t, "target_change", says))
    return State(state.tracks, state.target, serial, NO_REPORT, *state[4:8], smooth, own_state, given), out


def _lateral(state: State, reading: TrackReading, speed: float, settings: Settings) -> float:
    """Distance from the own path, which bends with the yaw rate: m."""
    # a yaw rate that is not known bends nothing
    if not speed > MIN_CURVE_SPEED or not reading.t - state.yaw_at <= settings.yaw_rate:
        return reading.lateral
    # circle of curvature yaw_rate / speed, at small angles
    return reading.lateral - state.yaw_rate / speed * reading.distance**2 / 2


def _track(state: State, reading: TrackReading, settings: Settings) -> tuple[State, Out]:
    """One track's report: keep it, decide who is the lead, smooth the lead's own reports."""
    t, number = reading.t, reading.track
    before = state.tracks.get(number)
    followed = number == state.target
    # a track without an object is often sent as zeros; comparisons with NaN are false
    reports = reading.valid and reading.distance > 0.0 and reading.rate == reading.rate
    known = state.tracks.get(state.target)
    alive = known is not None and known.since == known.since and t - known.t <= settings.silent
    was_none = not followed and before is not None and before.since != before.since
    if was_none and not reports and (alive or state.target < 0):
        return (state, []) if alive else _lost(state, t, settings)
    corridor = settings.in_path * (FOLLOWED_PATH_FACTOR if followed else 1.0)
    speed = own_speed.latest(state.own, t, settings.speed)
    over_ground = speed + reading.rate
    # a side that is not reported this time is not in the path: NaN compares as false
    in_path = not settings.sideways or abs(_lateral(state, reading, speed, settings)) <= corridor
    candidate = reports and in_path
    if candidate and not followed:
        candidate = not (over_ground < MIN_GROUND_SPEED and speed > MIN_GROUND_SPEED)
    if alive and was_none and not candidate:
        return state, []  # it was none and is none, and nobody is looked for
    since = t if before is None or before.since != before.since or reading.new else before.since
    track = Track(t, reading.distance, reading.rate, since if candidate else NAN)
    state = state._replace(tracks={**state.tracks, number: track})

    known = state.tracks.get(state.target)
    alive = known is not None and known.since == known.since and t - known.t <= settings.silent
    if (
        followed
        and reading.new
        and not smoothing.fits(state.smooth, t, reading.distance, reading.rate, settings.noise, settings.age)
    ):
        alive = False
    limit = known.distance - MIN_DISTANCE_STEP_M if alive and known is not None else float("inf")
    best = _nearest(state, t, limit, settings.silent)
    out: Out = []
    if best >= 0 and best != state.target:
        state, out = _hand_over(state, t, best, settings)
    elif not alive:
        state, out = _lost(state, t, settings)
    if number == state.target and state.tracks[number].since == state.tracks[number].since:
        state, more = _follow(state, t, reading.distance, reading.rate, settings)
        out += more
    return state, out


def without_object(state: State, t: Array, settings: Settings) -> tuple[State, int, npt.NDArray[np.int64]]:
    """Reports without an object, of tracks that had none, as `step` takes them one by one.

    Args:
        state: before the first of them.
        t: (n,) s, of the reports.
        settings: of the lead.

    Returns:
        the next state; how many of the reports it is behind, 0 where the first needs a step of its own; and which of
        them say once more that there is no lead, `lead.NO_LEAD` later by `smoothing.LEAD_LAG_S`.

    Example:
        >>> without_object(init(), np.array([1.0, 1.0, 1.1]), Settings(from_tracks=True))[1:]
        (3, array([0, 2]))
    """
    known = state.tracks.get(state.target)
    if known is not None:
        silent = np.flatnonzero(t - known.t > settings.silent)
        return state, int(silent[0]) if silent.size else len(t), _NONE
    at = t - smoothing.LEAD_LAG_S
    given = np.maximum.accumulate(np.concatenate([[state.given], at]))
    says = np.flatnonzero(at > given[:-1])
    state = state._replace(given=float(given[-1]), smooth=smoothing.fresh(state.smooth))
    return state, len(t), says


def is_followed(state: State, t: float, settings: Settings) -> bool:
    """Whether a track is followed that has reported lately, at t [s]: then reports without an object change nothing."""
    known = state.tracks.get(state.target)
    return known is not None and t - known.t <= settings.silent


def is_none(state: State, number: int) -> bool:
    """Whether the latest report of a track was of no vehicle in the path."""
    track = state.tracks.get(number)
    return track is not None and track.since != track.since


def _nearest(state: State, t: float, limit: float, silent: float) -> int:
    """Return the nearest track that has persisted in the path, nearer than `limit`; -1: none."""
    candidates = [
        (track.distance, number)
        for number, track in state.tracks.items()
        if t - track.t <= silent and track.t - track.since >= MIN_PERSISTENCE_S and track.distance < limit
    ]
    return min(candidates)[1] if candidates else -1


def _hand_over(state: State, t: float, best: int, settings: Settings) -> tuple[State, Out]:
    """Follow another track; where the filter finds that it is the same vehicle, its history goes on."""
    track = state.tracks[best]
    if smoothing.fits(state.smooth, t, track.distance, track.rate, settings.noise, settings.age):
        return state._replace(target=best), []
    points = smoothing.flush(state.smooth, settings.age)
    given = points[-1].t if points else state.given
    out = _readings(points, state.serial)
    if state.smooth.history and state.smooth.history[-1].t < t:
        given = 0.5 * (state.smooth.history[-1].t + t)
        out += _nothing(given)
    smooth = smoothing.fresh(state.smooth)
    return state._replace(target=best, smooth=smooth, given=given), out
