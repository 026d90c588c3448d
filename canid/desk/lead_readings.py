"""`lead.step` for a chunk of decoded columns: it sees the readings that matter to it, all others pass."""

from __future__ import annotations

from collections import defaultdict
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid import lead
from canid.pipeline import reported
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


def step(state: lead.State, said: Decoded, chunk: Columns, settings: lead.Settings) -> tuple[lead.State, Led]:
    """Take what a chunk says through `lead.step`; see there."""
    own = OF_TRACKS if settings.from_tracks else OF_SIGNALS
    feed = [readings for readings in said.roles if readings.role in own]
    if settings.from_tracks:
        passed = tuple(said.roles)
        fed = _with_tracks(feed, said, chunk)
    else:
        passed = tuple(readings for readings in said.roles if readings.role not in own)
        fed = _with_ticks(feed, said, chunk, state.pending[0])
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
        for item in reported(reading, state.target):
            made[item.role].append((item.t, item.value, row))
    columns = {role: np.array(found).T for role, found in made.items()}
    return state, Led(
        passed,
        {
            role: Made(t.copy(), value.copy(), row.astype(np.int64))
            for role, (t, value, row) in columns.items()
        },
        tuple(events),
    )


_Fed = list[tuple[int, Reading | TrackReading]]
_Ordered = list[tuple[int, int, Reading | TrackReading]]


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


def _with_ticks(feed: list[RoleReadings], said: Decoded, chunk: Columns, pending: float) -> _Fed:
    """Gap, range rate and whether they are valid; and after each report one reading that shows that it is over.

    Live that is the next reading of whatever role, and all that the lead takes from it is its time.
    """
    rows = np.unique(np.concatenate([np.zeros(0, np.int64), *(readings.row for readings in said.roles)]))
    t = chunk.t[rows]
    report = np.isin(rows, np.concatenate([np.zeros(0, np.int64), *(readings.row for readings in feed)]))
    tick = np.zeros(len(rows), bool)
    begins = np.flatnonzero(report)
    if pending == pending:
        begins = np.concatenate([[-1], begins])
    for k in begins.tolist():
        since = t[k] if k >= 0 else pending
        k += 1
        # a report that comes before any later reading takes this one's place
        while k < len(rows) and t[k] <= since and not report[k]:
            k += 1
        if k < len(rows):
            tick[k] = True
    ticks: _Ordered = [
        # before what the frame itself says
        (row, -1, Reading(at, "", NAN))
        for row, at in zip(rows[tick].tolist(), t[tick].tolist(), strict=True)
    ]
    return _sorted(ticks + _readings(feed, chunk))
