"""A chunk's gap, range rate and radar tracks, in the order of their frames, through the lead; all other roles pass."""

from __future__ import annotations

from collections import defaultdict
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.samples import lead
from canid.types import NAN, Array, Columns, Event, Reading, TrackReading
from canid.vehicle.decoding import Decoded, RoleReadings

Ints = npt.NDArray[np.int64]

# the roles that the lead replaces where it is given as signals; those that it needs as well: the own speed,
# and for the choice among radar tracks the own path
LEAD_ROLES = frozenset(("gap", "range_rate", "lead_valid"))
OWN_ROLES = frozenset(("speed",))
PATH_ROLES = frozenset(("speed", "yaw_rate"))

# the lead as the radar reported it, as signals of their own: smoothing makes gap and range rate agree with each other,
# and a frozen report move, so what is wrong with the radar itself can be seen in these alone
REPORTED = {"gap": "gap_reported", "range_rate": "range_rate_reported"}


class Made(NamedTuple):
    """Readings of one role that the lead made."""

    t: Array  # (m,) s
    value: Array  # (m,)
    row: Ints  # (m,) which frame of the chunk brought it


class Following(NamedTuple):
    """A chunk once its lead is known."""

    passed: tuple[RoleReadings, ...]  # as they were decoded
    made: dict[str, Made]
    events: tuple[tuple[int, Event], ...]  # with the row of the frame that caused it


# (row, place within the frame, reading)
_Ordered = list[tuple[int, int, Reading | TrackReading]]


def step(
    state: lead.State, decoded: Decoded, chunk: Columns, settings: lead.Settings
) -> tuple[lead.State, Following]:
    """Take a chunk's readings through `lead.step`.

    Args:
        state: of the lead.
        decoded: the chunk.
        chunk: in session time.
        settings: of the lead.
    """
    own = PATH_ROLES if settings.from_tracks else LEAD_ROLES | OWN_ROLES
    relevant = [readings for readings in decoded.roles if readings.role in own]
    ordered = _readings(relevant, chunk)
    if settings.from_tracks:
        passed = decoded.roles
        ordered += _track_reports(decoded, len(relevant), chunk)
    else:
        ordered += _ends_of_reports(decoded, chunk, state.pending[0])
        passed = tuple(readings for readings in decoded.roles if readings.role not in LEAD_ROLES)
        passed += tuple(
            readings._replace(role=REPORTED[readings.role])
            for readings in relevant
            if readings.role in REPORTED
        )
    ordered.sort(key=itemgetter(0, 1))
    made: defaultdict[str, list[tuple[float, float, int]]] = defaultdict(list)
    events: list[tuple[int, Event]] = []
    for row, _, reading in ordered:
        state, out = lead.step(state, reading, settings)
        for item in out:
            if item is reading:  # what passes is in `passed` already
                continue
            if isinstance(item, Event):
                events.append((row, item))
            else:
                made[item.role].append((item.t, item.value, row))
        if isinstance(reading, TrackReading) and reading.track == state.target:
            made[REPORTED["gap"]].append((reading.t, reading.distance, row))
            made[REPORTED["range_rate"]].append((reading.t, reading.rate, row))
    return state, Following(passed, {role: _columns(items) for role, items in made.items()}, tuple(events))


def _columns(items: list[tuple[float, float, int]]) -> Made:
    t, value, row = np.array(items).T
    return Made(t, value, row.astype(np.int64))


def _readings(relevant: list[RoleReadings], chunk: Columns) -> _Ordered:
    return [
        (row, place, Reading(t, role, value))
        for place, (role, rows, values) in enumerate(relevant)
        for row, t, value in zip(rows.tolist(), chunk.t[rows].tolist(), values.tolist(), strict=True)
    ]


def _track_reports(decoded: Decoded, first_place: int, chunk: Columns) -> _Ordered:
    out: _Ordered = []
    for place, track in enumerate(decoded.tracks, first_place):
        columns = (track.distance, track.rate, track.lateral, track.valid, track.new)
        rows, t = track.row.tolist(), chunk.t[track.row].tolist()
        out += [
            (row, place, TrackReading(at, track.track, *numbers))
            for row, at, *numbers in zip(rows, t, *(column.tolist() for column in columns), strict=True)
        ]
    return out


def _ends_of_reports(decoded: Decoded, chunk: Columns, pending: float) -> _Ordered:
    """One empty reading after each report of gap and range rate, at the next frame with a reading: the report is over.

    Args:
        decoded: the chunk.
        chunk: in session time.
        pending: s, time of the report that is being collected; NaN: none.
    """
    reads = np.zeros(len(chunk.t), bool)
    reports = np.zeros(len(chunk.t), bool)
    for readings in decoded.roles:
        reads[readings.row] = True
        if readings.role in REPORTED:
            reports[readings.row] = True
    rows = np.flatnonzero(reads)
    out: _Ordered = []
    since = pending
    for row, t, report in zip(rows.tolist(), chunk.t[rows].tolist(), reports[rows].tolist(), strict=True):
        if t > since:
            # before what the frame itself holds
            out.append((row, -1, Reading(t, "", NAN)))
            since = NAN
        if report:
            since = t
    return out
