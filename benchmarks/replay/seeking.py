"""How long a seek takes in a replay that has run: from the request to the piece at the target, by wall clock."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from canid.analysis.playback.playback import Played, Position, play
from canid.io.logs import open_log
from canid.io.recording.controls import Controls
from canid.signals.vehicle import Vehicle

# targets, drawn over the whole log, back and forth
SEEKS = 20


def seeks(path: Path, vehicle: Vehicle, seed: int = 1) -> list[float]:
    """Seconds of each seek.

    Args:
        path: of the log, which is run once first.
        vehicle: its vehicle.
        seed: of the targets.
    """
    controls = Controls()
    out: list[float] = []
    asked, began, targets = 0.0, 0.0, np.empty(0)
    t = 0.0
    for one in play(open_log(path), vehicle, controls, interactive=True, stays=True):
        if isinstance(one, Position):
            if one.ended and not targets.size:
                targets = np.random.default_rng(seed).uniform(0.0, t, SEEKS)
                controls.set_speed(1.0)
                asked, began = float(targets[0]), time.perf_counter()
                controls.seek(asked)
            continue
        assert isinstance(one, Played)
        t = one.t
        # pieces before it are not shown: a seek ends with the one that lies at the target
        if began and abs(t - asked) < 0.5:
            out.append(time.perf_counter() - began)
            if len(out) == SEEKS:
                controls.stop()
                continue
            asked, began = float(targets[len(out)]), time.perf_counter()
            controls.seek(asked)
    return out
