"""A chunk's gap, range rate and radar tracks, in the order of their frames, through the lead; all other roles pass."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from itertools import islice
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.signals.samples import lead
from canid.signals.samples.lead import REPORTED
from canid.signals.samples.smoothing import LEAD_LAG_S
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.types import NAN, Array, Columns, Event, Reading, TrackReading

Ints = npt.NDArray[np.int64]

# the roles that the lead replaces where it is given as signals; those that it needs as well: the own speed,
# and for the choice among radar tracks the own path
LEAD_ROLES = frozenset(("gap", "range_rate", "lead_valid"))
OWN_ROLES = frozenset(("speed",))
PATH_ROLES = frozenset(("speed", "yaw_rate"))
_NO_ROWS = np.zeros(0, np.int64)


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
_Ordered = list[tuple[int, int, Reading]]


def step(
    state: lead.State, decoded: Decoded, chunk: Columns, settings: lead.Settings, pauses: Ints = _NO_ROWS
) -> tuple[lead.State, Following]:
    """Take a chunk's readings through `lead.step`.

    Args:
        state: of the lead.
        decoded: the chunk.
        chunk: in session time.
        settings: of the lead.
        pauses: rows of the frames that come behind a pause.
    """
    paused = RoleReadings(lead.PAUSE, pauses, np.zeros(len(pauses)))
    if settings.from_tracks:
        return _by_tracks(state, decoded, chunk, settings, paused)
    relevant = [readings for readings in decoded.roles if readings.role in LEAD_ROLES | OWN_ROLES]
    # before all that its frame holds, and behind the end of the report before it
    ordered = _readings([paused, *relevant], chunk)
    ordered += _ends_of_reports(decoded, chunk, state.pending[0])
    passed = tuple(readings for readings in decoded.roles if readings.role not in LEAD_ROLES)
    passed += tuple(
        readings._replace(role=REPORTED[readings.role]) for readings in relevant if readings.role in REPORTED
    )
    ordered.sort(key=itemgetter(0, 1))
    made = _Made(defaultdict(list), [])
    for row, _, reading in ordered:
        state, out = lead.step(state, reading, settings)
        made.take(out, reading, row)
    return state, made.following(passed)


class _Made(NamedTuple):
    """What a chunk has made so far."""

    readings: defaultdict[str, list[tuple[float, float, int]]]  # role -> t, value, row
    events: list[tuple[int, Event]]

    def take(self, out: lead.Out, reading: Reading | TrackReading, row: int) -> None:
        """What one reading made; what passes is in `Following.passed` already."""
        for item in out:
            if item is reading:
                continue
            if isinstance(item, Event):
                self.events.append((row, item))
            else:
                self.add(item.role, item.t, item.value, row)

    def add(self, role: str, t: float, value: float, row: int) -> None:
        """One reading."""
        self.readings[role].append((t, value, row))

    def following(self, passed: tuple[RoleReadings, ...]) -> Following:
        """The chunk."""
        made = {role: _columns(items) for role, items in self.readings.items()}
        return Following(passed, made, tuple(self.events))


class _Reports(NamedTuple):
    """Reports of a chunk's tracks, and readings of the own path (track -1), in their order."""

    row: Ints
    t: Array
    track: Ints
    values: Array  # (n, 3) distance, rate and side of a track's report, or a reading's value first
    valid: npt.NDArray[np.bool_]
    new: npt.NDArray[np.bool_]
    role: Ints  # which of the readings of the own path; -1: a track's report


# one row of them
_One = tuple[int, float, int, tuple[float, float, float], bool, bool, int]


def _by_tracks(
    state: lead.State, decoded: Decoded, chunk: Columns, settings: lead.Settings, paused: RoleReadings
) -> tuple[lead.State, Following]:
    """The lead among radar tracks: reports that say nothing, most of a radar's, are taken together."""
    path = [paused, *(readings for readings in decoded.roles if readings.role in PATH_ROLES)]
    reports = _in_order(path, decoded, chunk)
    made = _Made(defaultdict(list), [])
    latest = np.maximum.accumulate(reports.t)
    busy = np.flatnonzero(~_say_nothing(state, reports))

    def take(item: _One) -> None:
        """Take a reading or report by itself."""
        nonlocal state
        row, t, track, (distance, rate, side), valid, new, role = item
        reading: Reading | TrackReading
        if role >= 0:
            reading = Reading(t, path[role].role, distance)
        else:
            reading = TrackReading(t, track, distance, rate, side, valid, new)
        state, out = lead.step(state, reading, settings)
        made.take(out, reading, row)
        if isinstance(reading, TrackReading) and reading.track == state.target:
            made.add(REPORTED["gap"], reading.t, reading.distance, row)
            made.add(REPORTED["range_rate"], reading.t, reading.rate, row)

    done = 0
    items: Iterator[_One] = zip(*(column[busy].tolist() for column in reports), strict=True)
    for k in [*busy.tolist(), len(reports.row)]:
        # most of these stretches last for a fraction of a cycle
        if done < k and lead.is_followed(state, float(latest[k - 1]), settings):
            done = k
        while done < k:
            state, n, says = lead.without_object(state, reports.t[done:k], settings)
            for at in (done + says).tolist():
                for role, value in lead.NO_LEAD.items():
                    made.add(role, float(reports.t[at]) - LEAD_LAG_S, value, int(reports.row[at]))
            done += n
            if done < k:
                take(next(zip(*(column[done : done + 1].tolist() for column in reports), strict=True)))
                done += 1
        for item in islice(items, 1):
            take(item)
        done = k + 1
    return state, made.following(decoded.roles)


def _in_order(path: list[RoleReadings], decoded: Decoded, chunk: Columns) -> _Reports:
    """Of one frame, readings come before reports."""
    parts = []
    for k, (_, row, value) in enumerate(path):
        no, none = np.zeros(len(row), bool), np.full(len(row), -1)
        values = np.column_stack([value, value, value])
        parts.append(_Reports(row, chunk.t[row], none, values, no, no, np.full(len(row), k)))
    for track in decoded.tracks:
        row = track.row
        values = np.column_stack([track.distance, track.rate, track.lateral])
        number, none = np.full(len(row), track.track), np.full(len(row), -1)
        parts.append(_Reports(row, chunk.t[row], number, values, track.valid, track.new, none))
    if not parts:
        none = np.zeros(0, np.int64)
        return _Reports(none, np.zeros(0), none, np.zeros((0, 3)), none > 0, none > 0, none)
    joined = _Reports._make(np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(joined.row, kind="stable")
    return _Reports._make(column[order] for column in joined)


def _say_nothing(state: lead.State, reports: _Reports) -> npt.NDArray[np.bool_]:
    """Which reports are without an object, of a track whose last report was, too."""
    distance, rate = reports.values[:, 0], reports.values[:, 1]
    empty = (reports.role < 0) & ~(reports.valid & (distance > 0.0) & (rate == rate))
    order = np.argsort(reports.track, kind="stable")
    tracks, of_track = reports.track[order], empty[order]
    before = np.concatenate([[False], of_track[:-1]])
    first = np.flatnonzero(np.diff(tracks, prepend=-2))
    before[first] = [lead.is_none(state, number) for number in tracks[first].tolist()]
    nothing = np.zeros(len(empty), bool)
    nothing[order] = of_track & before
    return nothing


def _columns(items: list[tuple[float, float, int]]) -> Made:
    t, value, row = np.array(items).T
    return Made(t, value, row.astype(np.int64))


def _readings(relevant: list[RoleReadings], chunk: Columns) -> _Ordered:
    return [
        (row, place, Reading(t, role, value))
        for place, (role, rows, values) in enumerate(relevant)
        for row, t, value in zip(rows.tolist(), chunk.t[rows].tolist(), values.tolist(), strict=True)
    ]


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
