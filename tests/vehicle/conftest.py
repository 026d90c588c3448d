"""Where the vehicles and the measured logs are."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from canid.types import Event, Frame, Reading, TrackReading
from canid.vehicle import Decoding, Vehicle, decoder

ROOT = Path(__file__).parents[2]
DATA = (ROOT / "../shared/data").resolve()


@pytest.fixture
def measured() -> Path:
    if not DATA.is_dir():
        pytest.skip(f"measured logs are not there: {DATA}")
    return DATA


@pytest.fixture
def decode_all():
    def run(
        vehicle: Vehicle, frames: Iterable[Frame]
    ) -> tuple[Decoding, list[Reading | TrackReading | Event]]:
        init, step = decoder(vehicle)
        state, out = init(), []
        for frame in frames:
            state, made = step(state, frame)
            out += made
        return state, out

    return run
