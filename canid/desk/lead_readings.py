"""`lead.step` for a chunk of decoded columns: it sees the readings that matter to it, all others pass."""

from __future__ import annotations

from collections import defaultdict
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid import lead
from canid.desk import smoothing_runs
from canid.pipeline import REPORTED, reported
from canid.types import NAN, Array, Columns, Event, Reading, TrackReading
from canid.vehicle.column_decoding import Decoded, RoleReadings

Ints = npt.NDArray[np.int64]

# What the lead is made of where it is a signal; and what choosing it among radar tracks needs beside them.
OF_SIGNALS = ("gap", "range_rate", "lead_valid")
OF_TRACKS = ("speed", "yaw_rate")


class Made(NamedTuple):
    """Readings of one role that the lead made."""

    t: Array  # (m,) s
    value: Array  # (m,)
    row: Ints  # (m,) which frame of the chunk brought it


class Led(NamedTuple):
    """What a chunk says once its lead is known."""

    passed: tuple[RoleReadings, ...]  # as they were decoded
    made: dict[str, Made]
    events: tuple[tuple[int, Event], ...]  # with the row of the frame that made it


_Fed = list[tuple[int, Reading | TrackReading]]
_Ordered = list[tuple[int, int, Reading | TrackReading]]
_Found = defaultdict[str, list[Array]]  # role -> (3, n) each: t, value, row

# Reports from which on a run of them is worth what numpy costs; where one ends sooner, so many go one by one.
SHORTEST = 16


def step(state: lead.State, said: Decoded, chunk: Columns, settings: lead.Settings) -> tuple[lead.State, Led]:
    """Take what a chunk says through `lead.step`; see there."""
    own = OF_TRACKS if settings.from_tracks else OF_SIGNALS
    feed = [readings for readings in said.roles if readings.role in own]
    found: _Found = defaultdict(list)
    if settings.from_tracks:
        passed = tuple(said.roles)
        state, events = _one_by_one(state, _with_tracks(feed, said, chunk), settings, found)
    else:
        passed = tuple(readings for readings in said.roles if readings.role not in own)
        unsmoothed = [readings for readings in feed if readings.role in REPORTED]
        passed += tuple(readings._replace(role=REPORTED[readings.role]) for readings in unsmoothed)
        state, events = _of_signals(state, feed, said, chunk, settings, found)
    columns = {role: np.concatenate(parts, axis=1) for role, parts in found.items()}
    return state, Led(
        passed,
        {role: Made(t, value, row.astype(np.int64)) for role, (t, value, row) in columns.items()},
        tuple(events),
    )


def _one_by_one(
    state: lead.State, fed: _Fed, settings: lead.Settings, found: _Found
) -> tuple[lead.State, list[tuple[int, Event]]]:
    """Take each reading through `lead.step`; what it makes is added to `found`."""
    made: defaultdict[str, list[tuple[float, float, int]]] = defaultdict(list)
    events: list[tuple[int, Event]] = []
    for row, reading in fed:
        state, out = lead.step(state, reading, settings)
        for item in out:
            if item is reading:  # what passes is in `passed` already
                continue
            if isinstance(item, Event):
                events.append((row, item))
            else:
                made[item.role].append((item.t, item.value, row))
        if settings.from_tracks:  # of signals it is in `passed`
            for item in reported(reading, state.target):
                made[item.role].append((item.t, item.value, row))
    for role, items in made.items():
        found[role].append(np.array(items).T)
    return state, events


def _of_signals(
    state: lead.State,
    feed: list[RoleReadings],
    said: Decoded,
    chunk: Columns,
    settings: lead.Settings,
    found: _Found,
) -> tuple[lead.State, list[tuple[int, Event]]]:
    """Reports of one message as runs, as far as they are ordinary; all else reading by reading."""
    ticks = _ticks(feed, said, chunk, state.pending[0])
    by_role = {readings.role: readings for readings in feed}
    rows = feed[0].row if feed else np.zeros(0, np.int64)
    alike = len(feed) == len(by_role) and all(np.array_equal(readings.row, rows) for readings in feed)
    if not (alike and {"gap", "range_rate"} <= by_role.keys()) or len(rows) < SHORTEST:
        return _one_by_one(state, _sorted(ticks + _readings(feed, chunk)), settings, found)
    t, gap, rate = chunk.t[rows], by_role["gap"].value, by_role["range_rate"].value
    over = np.array([row for row, _, _ in ticks], np.int64)
    at = np.searchsorted(over, rows, side="right")
    # with which frame each report is known to be over; the last one's may be in the next chunk
    ends = np.append(over, len(chunk.t))[at]
    ordinary = np.isfinite(gap) & np.isfinite(rate) & (np.append(chunk.t, -np.inf)[ends] > t)
    if "lead_valid" in by_role:
        ordinary &= by_role["lead_valid"].value == 1.0
    else:
        ordinary &= _valid(state, t, settings)
    events: list[tuple[int, Event]] = []
    fed = _sorted([item for item in ticks if not len(rows) or item[0] <= rows[0]])
    state, more = _one_by_one(state, fed, settings, found)
    events += more
    i = 0
    while i < len(rows):
        stop = i + int(np.argmin(np.append(ordinary[i:], False)))
        taken = 0
        if stop - i >= SHORTEST:
            part = slice(i, stop)
            smooth, taken, smoothed = smoothing_runs.step(
                state.smooth, t[part], gap[part], rate[part], settings.noise, settings.age
            )
            if taken:
                state = state._replace(smooth=smooth, pending=lead.NOTHING)
                if "lead_valid" in by_role:
                    state = state._replace(valid=1.0, valid_at=float(t[i + taken - 1]))
            if smoothed is not None:
                _add(found, smoothed, ends[i:stop][smoothed.by], state.serial)
            i += taken
        if i < len(rows):
            # one by one over what the run ended at, and what begins anew behind it
            until = min(i + SHORTEST, len(rows))
            fed = _between(feed, ticks, chunk, rows, i, until)
            state, more = _one_by_one(state, fed, settings, found)
            events += more
            i = until
    return state, events


def _valid(state: lead.State, t: Array, settings: lead.Settings) -> npt.NDArray[np.bool_]:
    """Which reports `lead.validity` takes for valid where no `lead_valid` comes meanwhile: (n,)."""
    age = settings.valid
    if state.valid_at == state.valid_at and age is not None:
        return (state.valid == 1.0) & ~(t - state.valid_at > age)
    return np.full(len(t), lead.validity(state, 0.0, settings) == 1.0)


def _add(found: _Found, smoothed: smoothing_runs.Smoothed, row: Ints, serial: int) -> None:
    """Add what `lead` makes of smoothed reports."""
    made = {
        "gap": smoothed.gap,
        "range_rate": smoothed.range_rate,
        "lead_valid": np.ones(len(row)),
        "target": np.full(len(row), float(serial)),
    }
    for role, value in made.items():
        found[role].append(np.array([smoothed.t, value, row]))


def _between(
    feed: list[RoleReadings], ticks: _Ordered, chunk: Columns, rows: Ints, i: int, until: int
) -> _Fed:
    """Return the readings of reports i to `until`, and what ends each of them."""
    of = [readings._replace(row=readings.row[i:until], value=readings.value[i:until]) for readings in feed]
    end = rows[until] if until < len(rows) else len(chunk.t)
    return _sorted([item for item in ticks if rows[i] < item[0] <= end] + _readings(of, chunk))


def _readings(feed: list[RoleReadings], chunk: Columns) -> _Ordered:
    """(row, place within the frame, reading)."""
    out: _Ordered = []
    for place, (role, rows, values) in enumerate(feed):
        t = chunk.t[rows].tolist()
        out += [
            (row, place, Reading(at, role, value))
            for row, at, value in zip(rows.tolist(), t, values.tolist(), strict=True)
        ]
    return out


def _sorted(found: _Ordered) -> _Fed:
    found.sort(key=itemgetter(0, 1))
    return [(row, reading) for row, _, reading in found]


def _with_tracks(feed: list[RoleReadings], said: Decoded, chunk: Columns) -> _Fed:
    found = _readings(feed, chunk)
    for place, track in enumerate(said.tracks, len(feed)):
        columns = (track.distance, track.rate, track.lateral, track.valid, track.new)
        t = chunk.t[track.row].tolist()
        found += [
            (row, place, TrackReading(at, track.track, *numbers))
            for row, at, *numbers in zip(track.row.tolist(), t, *(c.tolist() for c in columns), strict=True)
        ]
    return _sorted(found)


def _ticks(feed: list[RoleReadings], said: Decoded, chunk: Columns, pending: float) -> _Ordered:
    """After each report one reading that shows that it is over.

    Live that is the next reading of whatever role, and all that the lead takes from it is its time.
    """
    none = np.zeros(0, np.int64)
    spoken = np.zeros(len(chunk.t) + 1, bool)
    report = np.zeros(len(chunk.t) + 1, bool)
    for of, marks in ((said.roles, spoken), (feed, report)):
        for readings in of:
            marks[readings.row] = True
    rows = np.flatnonzero(spoken)
    t, report = chunk.t[rows], report[rows]
    begins = np.flatnonzero(report)
    since = t[begins]
    if pending == pending:
        begins, since = np.concatenate([[-1], begins]), np.concatenate([[pending], since])
    after = begins + 1
    there = after < len(rows)
    after, since = after[there], since[there]
    # a report that comes before any later reading takes this one's place
    plain = (t[after] > since) | report[after]
    found = [after[plain]] if len(after) else [none]
    for k, from_ in zip(after[~plain].tolist(), since[~plain].tolist(), strict=True):
        while k < len(rows) and t[k] <= from_ and not report[k]:
            k += 1
        if k < len(rows):
            found.append(np.array([k]))
    tick = np.unique(np.concatenate(found))
    return [
        # before what the frame itself says
        (row, -1, Reading(at, "", NAN))
        for row, at in zip(rows[tick].tolist(), t[tick].tolist(), strict=True)
    ]
