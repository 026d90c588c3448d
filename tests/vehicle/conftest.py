"""Where the vehicles and the measured logs are."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from canid.signals.vehicle import Decoding, Vehicle, decoder
from canid.values.frame_columns import chunks
from canid.values.types import Event, Frame, Reading, TrackReading

ROOT = Path(__file__).parents[2]


Readings = list[Reading | TrackReading | Event]


def decode(vehicle: Vehicle, frames: list[Frame], size: int) -> tuple[Decoding, list[Readings]]:
    """What each frame holds, decoded `size` frames at a time."""
    init, step = decoder(vehicle)
    state = init()
    out: list[Readings] = []
    for chunk in chunks(frames, size):
        state, decoded = step(state, chunk)
        rows: list[Readings] = [[] for _ in chunk.t]
        for row, event in decoded.events:
            rows[row].append(event)
        for role, row, value in decoded.roles:
            for k, x in zip(row.tolist(), value.tolist(), strict=True):
                rows[k].append(Reading(float(chunk.t[k]), role, x))
        for track, row, *columns in decoded.tracks:
            for k, *numbers in zip(row.tolist(), *(column.tolist() for column in columns), strict=True):
                rows[k].append(TrackReading(float(chunk.t[k]), track, *numbers))
        out += rows
    return state, out


def check_chunks(
    vehicle: Vehicle, frames: list[Frame], sizes: Iterable[int] = (7, 1000)
) -> tuple[Decoding, list[Readings]]:
    """Frames one by one and in chunks hold the same, to the last bit, and leave the same state."""
    state, readings = decode(vehicle, frames, 1)
    for size in sizes:
        other_state, other = decode(vehicle, frames, size)
        assert other_state == state
        # repr: NaN is NaN, -0.0 is not 0.0, and a numpy number is no float
        assert [repr(sorted(of, key=repr)) for of in other] == [repr(sorted(of, key=repr)) for of in readings]
    return state, readings


@pytest.fixture(scope="session")
def same_in_chunks():
    return check_chunks


@pytest.fixture(scope="session")
def decode_chunks():
    return decode


@pytest.fixture
def decode_all():
    def run(vehicle: Vehicle, frames: Iterable[Frame]) -> tuple[Decoding, Readings]:
        state, readings = check_chunks(vehicle, list(frames))
        return state, [item for of in readings for item in of]

    return run
