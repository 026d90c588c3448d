"""What the closed-loop simulation says: errors of both models, and whether the extended one is worse."""

from __future__ import annotations

import math

import numpy as np

from canid.values.findings import Report, Trajectory
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit
from canid.values.types import Array, Interval


def rms_error(trajectory: Trajectory, simulated: Array) -> float:
    """Root mean square of a trajectory's error, where it was simulated."""
    here = np.isfinite(simulated) & np.isfinite(trajectory.measured)
    return float(np.sqrt(np.mean((simulated - trajectory.measured)[here] ** 2))) if here.any() else math.nan


def has_extended(trajectory: Trajectory) -> bool:
    """Whether the extended model simulates this trajectory differently from the baseline."""
    return math.isfinite(trajectory.gain.value) or not np.array_equal(
        trajectory.before, trajectory.after, equal_nan=True
    )


def gain(trajectory: Trajectory) -> Interval:
    """Relative reduction of the error's variance; without an interval where there are too few stretches for one.

    Example:
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> gain(Trajectory("gap", zero, one, two, Interval()))
        Interval(value=-3.0, low=nan, high=nan)
    """
    if math.isfinite(trajectory.gain.value) or not has_extended(trajectory):
        return trajectory.gain
    before, after = rms_error(trajectory, trajectory.before), rms_error(trajectory, trajectory.after)
    return Interval(1 - (after / before) ** 2) if before > 0 else Interval()


def worse(trajectory: Trajectory) -> bool:
    """Whether the extended model's error is larger than the baseline's."""
    return gain(trajectory).value < 0


def change(trajectory: Trajectory) -> str:
    """Change of the error's variance, with its sign and 95 % interval.

    Example:
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> change(Trajectory("gap", zero, one, two, Interval(-3.0, -4.0, -2.0)))
        '+300 [+200, +400] %'
        >>> change(Trajectory("gap", zero, one, two, Interval()))
        '+300 % (too few stretches for an interval)'
    """
    known = gain(trajectory)
    value, low, high = -100 * known.value, -100 * known.high, -100 * known.low
    if not (math.isfinite(low) and math.isfinite(high)):
        return f"{value:+.0f} % (too few stretches for an interval)"
    return f"{value:+.0f} [{low:+.0f}, {high:+.0f}] %"


def errors(trajectory: Trajectory) -> str:
    """Rms error of the baseline, and of the extended model.

    Example:
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> errors(Trajectory("gap", zero, one, two, Interval(-3.0, -4.0, -2.0)))
        'gap 1 → 2 m rms'
    """
    unit = role_unit(trajectory.role)
    before, after = (
        number(rms_error(trajectory, simulated)) for simulated in (trajectory.before, trajectory.after)
    )
    return (
        f"{readable(trajectory.role)} {before}{f' → {after}' if has_extended(trajectory) else ''} {unit} rms"
    )


def warning(report: Report) -> str:
    """The sentence of the verdict on a closed loop that gets worse with the extended model; "" where it does not.

    Example:
        >>> from types import SimpleNamespace
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> of = Trajectory("gap", zero, one, two, Interval(-3.0, -4.0, -2.0))
        >>> warning(SimpleNamespace(closed_loop=(of,)))
        'In closed loop the extended model is worse: error of the gap 1 → 2 m rms, error variance +300 [+200, +400] %.'
    """
    lost = [trajectory for trajectory in report.closed_loop if worse(trajectory)]
    if not lost:
        return ""
    parts = [f"{errors(trajectory)}, error variance {change(trajectory)}" for trajectory in lost]
    sure = any(trajectory.gain.high < 0 or math.isnan(trajectory.gain.high) for trajectory in lost)
    return (
        f"In closed loop the extended model is worse: error of the {'; of the '.join(parts)}"
        f"{'' if sure else ', which may be chance: the 95 % interval holds 0'}."
    )
