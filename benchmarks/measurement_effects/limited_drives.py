"""Drives of the outside simulators whose output is at a limit for a share of the time: the car gets the limited output."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from benchmarks.measurement_effects.drives import Drive, drawn_drive

Side = Literal["upper", "lower"]
# %; where the pedal of the simulator holds the mean speed when it is far from both ends
MIDDLE_PERCENT = 50.0
# rounds in which the limit is moved to where it is met for the share of the time: it changes what the loop asks for
ROUNDS = 3


def limited_drive(simulator: str, seed: int, share: float, side: Side, **how: float) -> Drive:
    """A drive of a drawn driver whose output is at a limit for about a share of the time.

    Args:
        simulator: a name of `SIMULATORS`. A pedal is moved towards 0 or 100 %, an acceleration gets a limit.
        seed: of driver, lead, noise and sensors.
        share: of the time; 0: the same drive, its output free.
        side: of the output.
        **how: settings of the simulator.
    """
    pedal = simulator == "Helly"
    sign = 1.0 if side == "upper" else -1.0
    free = {"level": MIDDLE_PERCENT, "limits": (-math.inf, math.inf)} if pedal else {}
    drive = drawn_drive(simulator, seed, **free, **how)
    if share <= 0.0:
        return drive
    output = sign * drive.columns[drive.truth.output]
    room = float(np.quantile(output, 1.0 - share)) - sign * (MIDDLE_PERCENT if pedal else 0.0)
    for _ in range(ROUNDS):
        if pedal:
            end = 100.0 if side == "upper" else 0.0
            drive = drawn_drive(simulator, seed, level=end - sign * room, **how)
        else:
            limits = (-math.inf, room) if side == "upper" else (-room, math.inf)
            drive = drawn_drive(simulator, seed, limits=limits, **how)
        now = at_limit(drive, side)
        if abs(now - share) < 0.2 * share:
            break
        output = sign * drive.columns[drive.truth.output]
        # by the free output's quantiles, which are about as far apart
        room += float(np.std(output)) * (now - share) / max(share, 0.25)
    return drive


def at_limit(drive: Drive, side: Side) -> float:
    """Share of the samples at the outermost value."""
    output = drive.columns[drive.truth.output]
    return float(np.mean(output == (output.max() if side == "upper" else output.min())))
