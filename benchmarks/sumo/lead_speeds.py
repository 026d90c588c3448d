"""How the lead drives: profiles drawn by canid's simulator, and the leads of recorded drives."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.sumo.sumo_drivers import STEP_S
from canid import read_trace
from canid.models.simulation.leads import LEADS, speed_profile
from canid.values.types import Array

# recorded drives that are long enough: file below --data, vehicle
RECORDED = (
    ("asta/asta_p3_f2_Tesla_Model3.blf", "openacc_asta"),
    ("asta/asta_p3_f4_Audi_A6.blf", "openacc_asta"),
    ("asta/asta_p10_f2_Audi_A6.blf", "openacc_asta"),
    ("asta/asta_p10_f4_Mercedes_AClass.blf", "openacc_asta"),
)
# m/s; slower is no car following
MIN_SPEED = 3.0
# every so many-th drive is behind a recorded lead
RECORDED_EVERY = 4


def lead_speeds(seed: int, minutes: float, data: Path) -> tuple[str, Array, Array]:
    """Draw the leads of the drive and of the second drive that judges, another kind of road or another recording.

    Args:
        seed: of the drive.
        minutes: of each.
        data: folder of the recorded drives.

    Returns:
        names of both; (n,) m/s each, at steps of `STEP_S`.
    """
    rng = np.random.default_rng([seed, 2])
    n = round(60 * minutes / STEP_S)
    there = [log for log in RECORDED if (data / log[0]).exists()]
    if seed % RECORDED_EVERY == RECORDED_EVERY - 1 and len(there) >= 2:
        pair = [there[k] for k in rng.permutation(len(there))[:2]]
        speeds = [_recorded(data / log, vehicle, n, rng) for log, vehicle in pair]
        return f"{Path(pair[0][0]).stem}, {Path(pair[1][0]).stem}", speeds[0], speeds[1]
    names = [tuple(LEADS)[k] for k in rng.permutation(len(LEADS))[:2]]
    speeds = [speed_profile(LEADS[name], n, STEP_S, rng) for name in names]
    return ", ".join(names), speeds[0], speeds[1]


def _recorded(log: Path, vehicle: str, n: int, rng: np.random.Generator) -> Array:
    """(n,) m/s from anywhere in the drive; shorter where the drive is."""
    t, speed = _lead(log, vehicle)
    last = max(float(t[-1]) - n * STEP_S, float(t[0]))
    grid = rng.uniform(float(t[0]), last) + STEP_S * np.arange(n)
    return np.interp(grid[grid <= t[-1]], t, speed)


@cache
def _lead(log: Path, vehicle: str) -> tuple[Array, Array]:
    trace = read_trace(log, vehicle)
    speed = trace.signals["speed"] + trace.signals["range_rate"]
    known = np.isfinite(speed)
    return trace.t[known], np.maximum(speed[known], MIN_SPEED)
