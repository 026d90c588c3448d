"""A planted lane drive as canid's sampler gives it: wheel angle and lateral offset by their sensors, at 10 Hz."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from canid.values.types import LearnGate, Trace
from tests.plants.planted_drive import Array

STEP_S = 0.1
# ° and m; steps of the sensors, and s, from one report of the camera to the next
ANGLE_STEP, OFFSET_STEP_M, CURVATURE_STEP, CAMERA_S = 0.1, 0.005, 2e-6, 0.05
# a parabola through five reports, at the middle one (Savitzky & Golay 1964)
PARABOLA = np.array([-3.0, 12.0, 17.0, 12.0, -3.0]) / 35.0


def trace(columns: Mapping[str, Array], dt: float) -> Trace:
    """Sample the columns of a simulated drive.

    Args:
        columns: "t", "steering_angle", "lateral_offset", "speed", and "curvature" where a camera measures it; (n,).
        dt: s.

    Example:
        >>> t = np.arange(3000) * 0.01
        >>> flat = trace({"t": t, "steering_angle": t, "lateral_offset": 0 * t, "speed": 0 * t + 25.0}, 0.01)
        >>> flat.input_names, flat.output[:3].round(1).tolist()
        (('lateral_offset',), [0.2, 0.3, 0.4])
    """
    every, camera = round(STEP_S / dt), round(CAMERA_S / dt)
    n = columns["t"].size
    offset = np.convolve(rounded(columns["lateral_offset"][::camera], OFFSET_STEP_M), PARABOLA, "same")
    # the parabola needs two reports on either side
    at = np.arange(2 * every, n - 2 * every, every)
    offset = offset[at // camera]
    signals = {
        "lateral_offset": offset,
        "steering_angle": rounded(columns["steering_angle"][at], ANGLE_STEP),
        "speed": columns["speed"][at],
    }
    if "curvature" in columns:
        signals["curvature"] = rounded(columns["curvature"][at], CURVATURE_STEP)
    m = at.size
    return Trace(
        STEP_S, columns["t"][at], signals["steering_angle"], offset[:, None], ("lateral_offset",),
        (LearnGate.OPEN,) * m, np.ones(m, dtype=bool), np.zeros(m, dtype=np.int64), signals,
    )  # fmt: skip


def rounded(x: Array, step: float) -> Array:
    """Values as a sensor with this step sends them."""
    return np.asarray(np.round(x / step) * step)
