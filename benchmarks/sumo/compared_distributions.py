"""One drive against its exported vehicle type in SUMO: distributions of gap, time gap, speed and acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.sumo.two_samples import Distances, distances, effective_number
from benchmarks.sumo.vehicle_type_drive import STEP_S, Run, drive
from canid.analysis.sumo.following import Following, distributions
from canid.values.runs import runs
from canid.values.types import Array

# s; shorter stretches hardly leave their measured beginning
MIN_RUN_S = 20.0
# of each stretch, with different random numbers
REPLICATES = 5


class Compared(NamedTuple):
    """Measured against simulated, and the halves of the drive against each other."""

    simulated: Distances
    halves: Distances
    independent: float  # effective number of measured values
    chance_ks: float  # KS distance below which two samples of that many values are 95 times of 100
    measured: tuple[float, float]  # mean and standard deviation
    got: tuple[float, float]  # simulated


Columns = dict[str, list[Array]]


def measured_runs(of: Following) -> list[Run]:
    """Stretches behind one lead, as long as they are."""
    same = np.r_[True, np.diff(of.segment) == 0]
    out = []
    for start, stop in runs(of.shown & same, round(MIN_RUN_S / of.dt)):
        t = np.arange(stop - start) * of.dt
        grid = np.arange(0.0, float(t[-1]), STEP_S)
        out.append(Run(*(np.interp(grid, t, x[start:stop]) for x in (of.gap, of.speed, of.lead))))
    return out


def measured_columns(of: Sequence[Run]) -> Columns:
    """Quantities of the measured runs, one array a run."""
    return _columns([(one.gap[:, None], one.speed[:, None]) for one in of])


def simulated_columns(of: Sequence[Run], types: str, name: str, seed: int) -> Columns:
    """Quantities of the vehicle type behind the leads of the runs."""
    return _columns([drive(types, name, one, REPLICATES, seed + k) for k, one in enumerate(of)])


def _columns(of: Sequence[tuple[Array, Array]]) -> Columns:
    out: Columns = {}
    for gap, speed in of:
        shown = np.ones(len(gap), dtype=bool)
        for k in range(gap.shape[1]):
            for name, x in distributions(gap[:, k], speed[:, k], shown, STEP_S).items():
                out.setdefault(name, []).append(x)
    return out


def compared(measured: Columns, simulated: Columns) -> dict[str, Compared]:
    """Compare each quantity."""
    out = {}
    for name, parts in measured.items():
        x, y = np.concatenate(parts), np.concatenate(simulated[name])
        half = x.size // 2
        n = sum(effective_number(part) for part in parts)
        m = sum(effective_number(part) for part in simulated[name])
        out[name] = Compared(
            distances(x, y),
            distances(x[:half], x[half:]),
            n,
            # of two samples, 5 % (Smirnov 1948)
            min(1.36 * float(np.sqrt(1.0 / n + 1.0 / m)), 1.0),
            (float(x.mean()), float(x.std())),
            (float(y.mean()), float(y.std())),
        )
    return out
