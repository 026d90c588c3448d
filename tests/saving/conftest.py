"""One drive through the pipeline, with the states that it went through."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from canid import logs, pipeline
from canid.frames import open_log
from canid.types import Frame
from canid.vehicle import Vehicle, read_vehicle

LOG = Path(__file__).parents[2] / "replay_logs" / "following_urban.blf"
SECONDS = 120.0


class Driven(NamedTuple):
    """A drive, whole."""

    vehicle: Vehicle
    running: pipeline.Pipeline
    frames: list[Frame]
    states: list[pipeline.State]  # after each frame; states share most of what they hold
    outputs: list[list[pipeline.Output]]  # of each frame

    def at(self, t: float) -> int:
        """Index of the first frame from `t` s on."""
        return next(i for i, frame in enumerate(self.frames) if frame.t >= t)


@pytest.fixture(scope="session")
def driven() -> Driven:
    """Two minutes of following; do not change it."""
    vehicle = read_vehicle("generic")
    running = pipeline.build(vehicle)
    frames = list(logs.window(open_log(LOG), 0.0, SECONDS))
    state, states, outputs = running.init(), [], []
    for frame in frames:
        state, out = running.step(state, frame)
        states.append(state)
        outputs.append(out)
    return Driven(vehicle, running, frames, states, outputs)
