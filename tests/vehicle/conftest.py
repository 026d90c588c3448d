"""Where the vehicles and the measured logs are."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from canid.frames.columns import chunks
from canid.types import Event, Frame, Reading, TrackReading
from canid.vehicle import Decoding, Vehicle, decoder
from canid.vehicle.column_decoding import column_decoder

ROOT = Path(__file__).parents[2]
DATA = (ROOT / "../shared/data").resolve()


@pytest.fixture
def measured() -> Path:
    if not DATA.is_dir():
        pytest.skip(f"measured logs are not there: {DATA}")
    return DATA


Said = list[Reading | TrackReading | Event]


def by_frames(vehicle: Vehicle, frames: Iterable[Frame]) -> tuple[Decoding, list[Said]]:
    """What each frame says."""
    init, step = decoder(vehicle)
    state, out = init(), []
    for frame in frames:
        state, made = step(state, frame)
        out.append(made)
    return state, out


def by_columns(vehicle: Vehicle, frames: list[Frame], size: int) -> tuple[Decoding, list[Said]]:
    """The same, decoded `size` frames at a time."""
    init, step = column_decoder(vehicle)
    state = init()
    out: list[Said] = []
    for chunk in chunks(frames, size):
        state, said = step(state, chunk)
        rows: list[Said] = [[] for _ in chunk.t]
        for row, event in said.events:
            rows[row].append(event)
        for role, row, value in said.roles:
            for k, x in zip(row.tolist(), value.tolist(), strict=True):
                rows[k].append(Reading(float(chunk.t[k]), role, x))
        for track, row, *columns in said.tracks:
            for k, *numbers in zip(row.tolist(), *(column.tolist() for column in columns), strict=True):
                rows[k].append(TrackReading(float(chunk.t[k]), track, *numbers))
        out += rows
    return state, out


def check_columns(vehicle: Vehicle, frames: list[Frame], sizes: Iterable[int] = (1, 7, 1000)) -> None:
    """Columns say what frames say, to the last bit, and remember the same."""
    state, said = by_frames(vehicle, frames)
    for size in sizes:
        other_state, other = by_columns(vehicle, frames, size)
        assert other_state == state
        # repr: NaN is NaN, -0.0 is not 0.0, and a numpy number is no float
        assert [repr(sorted(made, key=repr)) for made in other] == [
            repr(sorted(made, key=repr)) for made in said
        ]


@pytest.fixture(scope="session")
def same_by_columns():
    return check_columns


@pytest.fixture
def decode_all():
    def run(vehicle: Vehicle, frames: Iterable[Frame]) -> tuple[Decoding, Said]:
        frames = list(frames)
        check_columns(vehicle, frames)
        state, said = by_frames(vehicle, frames)
        return state, [item for made in said for item in made]

    return run
