"""Which samples of a drive show its driver behind a lead: other than for canid's own model, the brake and standstill too."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.models.diagnosis.driver.closed_loop import Stretch, stretches
from canid.models.diagnosis.driver.held_out import FOLD_BLOCK_S
from canid.values.findings import Flags
from canid.values.types import Array, LearnGate, Trace

# what a traffic simulator needs as well: gap and speed are measured, and the driver drives
SHOWN = (LearnGate.OPEN, LearnGate.BRAKE, LearnGate.PEDAL_FLOOR, LearnGate.OUTPUT_LIMIT, LearnGate.STANDSTILL)
# s of the difference quotient of the speed: the sensor's noise is then small against what is driven
ACCEL_S = 1.0
# stretches of a long drive, and s of the longest: enough of them for folds and intervals
STRETCHES, LONGEST_S = 10, 120.0
# %; the tails that a drive of some minutes knows
PERCENT = (0.5, 2.5, 5.0, 10.0, 25.0, 50.0, 75.0, 90.0, 95.0, 97.5, 99.5)
# m/s; below it a time gap says nothing
MIN_SPEED = 2.0


class Following(NamedTuple):
    """Columns (n,) of a drive."""

    gap: Array  # m
    speed: Array  # m/s
    lead: Array  # m/s
    shown: Flags
    segment: npt.NDArray[np.int64]  # its number: another lead, another number
    dt: float  # s


def following(trace: Trace) -> Following | None:
    """Lay out the columns; None: the drive has no lead."""
    names = ("gap", "speed", "range_rate")
    if any(name not in trace.signals for name in names) or not trace.t.size:
        return None
    gap, speed, rate = (trace.signals[name] for name in names)
    gate = np.array([state in SHOWN for state in trace.gate])
    shown = gate & np.isfinite(gap) & np.isfinite(speed) & np.isfinite(rate) & (gap > 0.0)
    return Following(
        gap, np.maximum(speed, 0.0), np.maximum(speed + rate, 0.0), shown, trace.segment, trace.dt
    )


def in_stretches(columns: Following) -> tuple[Stretch, ...]:
    """Stretches behind one lead: a tenth of the drive each, half a minute at least and two at most.

    In half a minute a model hardly leaves the measured state it began with: one that collides after a minute, or loses the
    lead, has the smallest error.
    """
    # a sample of another segment ends a run
    same = np.r_[True, np.diff(columns.segment) == 0] if columns.segment.size else np.zeros(0, dtype=bool)
    block = float(np.clip(columns.shown.sum() * columns.dt / STRETCHES, FOLD_BLOCK_S, LONGEST_S))
    return stretches(columns.shown & same, columns.dt, block)


def acceleration(speed: Array, shown: Flags, dt: float) -> tuple[Array, Flags]:
    """Difference quotient of the speed over `ACCEL_S`, (n - k,) m/s², and where all of it was shown."""
    k = max(round(ACCEL_S / dt), 1)
    if speed.size <= k:
        return np.zeros(0), np.zeros(0, dtype=bool)
    hidden = np.concatenate([[0], np.cumsum(~shown)])
    whole = hidden[k + 1 :] == hidden[: -k - 1]
    return (speed[k:] - speed[:-k]) / (k * dt), whole


def distributions(gap: Array, speed: Array, shown: Flags, dt: float) -> dict[str, Array]:
    """Values of gap m, time gap s, speed m/s and acceleration m/s² while following.

    Example:
        >>> shares = distributions(np.full(30, 20.0), np.full(30, 10.0), np.ones(30, dtype=bool), 0.1)
        >>> {name: float(x[0]) for name, x in shares.items()}
        {'gap': 20.0, 'time_gap': 2.0, 'speed': 10.0, 'accel': 0.0}
    """
    moving = shown & (speed > MIN_SPEED)
    accel, whole = acceleration(speed, shown, dt)
    return {
        "gap": gap[shown],
        "time_gap": gap[moving] / speed[moving],
        "speed": speed[shown],
        "accel": accel[whole],
    }


def quantiles(values: Mapping[str, Array]) -> dict[str, tuple[float, ...]]:
    """Quantiles at `PERCENT`; names without values are left out."""
    return {name: tuple(float(q) for q in np.percentile(x, PERCENT)) for name, x in values.items() if x.size}
