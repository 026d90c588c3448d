"""One drive through the pipeline, with the states that it went through."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from canid.io.logs import open_log
from canid.models.pipeline import pipeline
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.frame_columns import columns_of
from canid.values.types import Columns, Frame
from canid.values.window import Window

LOG = Path(__file__).parents[2] / "replay_logs" / "following_urban.blf"
SECONDS = 120.0


class Driven(NamedTuple):
    """A drive, whole."""

    vehicle: Vehicle
    running: pipeline.Pipeline
    chunks: list[Columns]  # of 100 ms each
    states: list[pipeline.State]  # after each chunk; states share most of what they hold
    outputs: list[list[pipeline.Output]]  # of each chunk

    def at(self, t: float) -> int:
        """Index of the first chunk from `t` s on."""
        return next(i for i, chunk in enumerate(self.chunks) if chunk.t[0] >= t)


@pytest.fixture(scope="session")
def driven() -> Driven:
    """Two minutes of following; do not change it."""
    vehicle = read_vehicle("generic")
    running = pipeline.build(vehicle)
    parts: dict[int, list[Frame]] = {}
    for frame in Window(0.0, SECONDS).frames(open_log(LOG)):
        parts.setdefault(int(frame.t / 0.1), []).append(frame)
    chunks = [columns_of(part) for part in parts.values()]
    state, states, outputs = running.init(), [], []
    for chunk in chunks:
        state, out = running.step(state, chunk)
        states.append(state)
        outputs.append([item for _, item in out])
    return Driven(vehicle, running, chunks, states, outputs)
