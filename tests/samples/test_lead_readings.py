"""A chunk's radar tracks taken together give what their reports give one by one."""

from __future__ import annotations

import numpy as np
import pytest

from canid.signals.samples import lead, lead_readings
from canid.signals.samples.lead import NO_LEAD, REPORTED, Settings
from canid.signals.vehicle.decoding_state import Decoded, RoleReadings, TrackReadings
from canid.values.types import NAN, Columns, Event, Reading, TrackReading

TRACKS, CYCLES = 24, 400


def drive(rng: np.random.Generator, leads: bool) -> tuple[Columns, Decoded]:
    """A radar at 20 Hz: the lead under changing numbers, objects off the road, most tracks empty; frames lost."""
    n = CYCLES * (TRACKS + 2)
    t = np.sort(
        np.repeat(0.05 * np.arange(CYCLES), TRACKS + 2) + np.tile(1e-4 * np.arange(TRACKS + 2), CYCLES)
    )
    t += np.where(rng.random(n) < 0.02, -0.003, 0.0)
    row = np.arange(n).reshape(CYCLES, TRACKS + 2)
    cycle = 0.05 * np.arange(CYCLES)
    speed = 20.0 + np.sin(cycle / 4.0)
    roles = (
        RoleReadings("speed", row[:, 0], np.round(speed, 2)),
        RoleReadings("yaw_rate", row[:, 1], np.where(rng.random(CYCLES) < 0.1, NAN, 0.02 * np.sin(cycle))),
    )
    tracks = []
    for k in range(TRACKS):
        distance, rate = np.zeros(CYCLES), np.zeros(CYCLES)
        lateral, valid = np.zeros(CYCLES), np.ones(CYCLES, bool)
        if leads and k < 4:
            begin = 5.0 * k + rng.uniform(0.0, 2.0)
            on = (cycle >= begin) & (cycle < begin + rng.uniform(3.0, 9.0)) & (rng.random(CYCLES) < 0.95)
            distance, rate = np.where(on, 30.0 + 6.0 * k - 0.5 * cycle, 0.0), np.full(CYCLES, -0.5)
        elif k < 8:
            on = rng.random(CYCLES) < 0.5
            distance, rate = np.where(on, rng.uniform(10.0, 90.0, CYCLES), 0.0), rng.normal(0.0, 3.0, CYCLES)
            lateral = rng.uniform(-8.0, 8.0, CYCLES) if leads else np.full(CYCLES, 6.0)
        elif k < 10:
            distance, rate = np.full(CYCLES, NAN), np.full(CYCLES, NAN)
            valid = rng.random(CYCLES) < 0.2
        there = rng.random(CYCLES) < 0.98
        new = rng.random(CYCLES) < 0.02
        parts = (distance, rate, lateral, valid, new)
        tracks.append(TrackReadings(k, row[there, 2 + k], *(part[there] for part in parts)))
    words = (np.zeros(n, kind) for kind in ("u2", "u4", "u1", "u1"))
    return Columns(t, *words, np.zeros((n, 8), np.uint8)), Decoded(roles, tuple(tracks), ())


def one_by_one(
    chunk: Columns, decoded: Decoded, settings: Settings
) -> tuple[lead.State, dict[str, list[tuple[float, float, int]]], list[tuple[int, Event]]]:
    """Every reading and report by `lead.step`, in the order of the frames."""
    readings: list[tuple[int, Reading | TrackReading]] = []
    for role, row, value in decoded.roles:
        readings += [(k, Reading(float(chunk.t[k]), role, float(x))) for k, x in zip(row, value, strict=True)]
    for track, row, *columns in decoded.tracks:
        for k, *numbers in zip(row.tolist(), *(column.tolist() for column in columns), strict=True):
            readings.append((k, TrackReading(float(chunk.t[k]), track, *numbers)))
    state, made, events = lead.init(), {}, []
    for row, reading in sorted(readings, key=lambda item: item[0]):
        state, out = lead.step(state, reading, settings)
        for item in out:
            if isinstance(item, Event):
                events.append((int(row), item))
            elif item is not reading:
                made.setdefault(item.role, []).append((item.t, item.value, int(row)))
        if isinstance(reading, TrackReading) and reading.track == state.target:
            made.setdefault(REPORTED["gap"], []).append((reading.t, reading.distance, int(row)))
            made.setdefault(REPORTED["range_rate"], []).append((reading.t, reading.rate, int(row)))
    return state, made, events


@pytest.mark.parametrize("leads", [True, False])
@pytest.mark.parametrize("sideways", [True, False])
def test_a_chunk_of_tracks_is_its_reports(seed: int, leads: bool, sideways: bool) -> None:
    """States, readings and events, to the last bit."""
    chunk, decoded = drive(np.random.default_rng(seed), leads)
    settings = Settings(from_tracks=True, sideways=sideways)
    state, of = lead_readings.step(lead.init(), decoded, chunk, settings)
    expected, made, events = one_by_one(chunk, decoded, settings)
    assert repr(state) == repr(expected)
    assert list(of.events) == events
    assert of.made.keys() == made.keys() >= NO_LEAD.keys()
    for role, (t, value, row) in of.made.items():
        assert repr(list(zip(t.tolist(), value.tolist(), row.tolist(), strict=True))) == repr(made[role]), (
            role
        )
