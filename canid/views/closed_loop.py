"""What the closed-loop simulation says: errors of both models, and whether the extended one is worse."""

from __future__ import annotations

import math

import numpy as np

from canid.findings import Report, Trajectory
from canid.types import Array, Interval
from canid.views.names import readable
from canid.views.numbers import number, role_unit


def rms_error(of: Trajectory, simulated: Array) -> float:
    """Root mean square of a trajectory's error, where it was simulated."""
    here = np.isfinite(simulated) & np.isfinite(of.measured)
    return float(np.sqrt(np.mean((simulated - of.measured)[here] ** 2))) if here.any() else math.nan


def has_extended(of: Trajectory) -> bool:
    """Whether the extended model simulates this trajectory differently from the baseline."""
    return math.isfinite(of.gain.value) or not np.array_equal(of.before, of.after, equal_nan=True)


def gain(of: Trajectory) -> Interval:
    """Relative reduction of the error's variance; without an interval where there are too few stretches for one.

    Example:
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> gain(Trajectory("gap", zero, one, two, Interval()))
        Interval(value=-3.0, low=nan, high=nan)
    """
    if math.isfinite(of.gain.value) or not has_extended(of):
        return of.gain
    before, after = rms_error(of, of.before), rms_error(of, of.after)
    return Interval(1 - (after / before) ** 2) if before > 0 else Interval()


def worse(of: Trajectory) -> bool:
    """Whether the extended model's error is larger than the baseline's."""
    return gain(of).value < 0


def change(of: Trajectory) -> str:
    """Change of the error's variance, with its sign and 95 % interval.

    Example:
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> change(Trajectory("gap", zero, one, two, Interval(-3.0, -4.0, -2.0)))
        '+300 [+200, +400] %'
        >>> change(Trajectory("gap", zero, one, two, Interval()))
        '+300 % (too few stretches for an interval)'
    """
    known = gain(of)
    value, low, high = -100 * known.value, -100 * known.high, -100 * known.low
    if not (math.isfinite(low) and math.isfinite(high)):
        return f"{value:+.0f} % (too few stretches for an interval)"
    return f"{value:+.0f} [{low:+.0f}, {high:+.0f}] %"


def errors(of: Trajectory) -> str:
    """Rms error of the baseline, and of the extended model.

    Example:
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> errors(Trajectory("gap", zero, one, two, Interval(-3.0, -4.0, -2.0)))
        'gap 1 → 2 m rms'
    """
    unit = role_unit(of.role)
    before, after = (number(rms_error(of, simulated)) for simulated in (of.before, of.after))
    return f"{readable(of.role)} {before}{f' → {after}' if has_extended(of) else ''} {unit} rms"


def warning(report: Report) -> str:
    """The sentence of the verdict on a closed loop that gets worse with the extended model; "" where it does not.

    Example:
        >>> from types import SimpleNamespace
        >>> zero, one, two = np.zeros(4), np.ones(4), np.full(4, 2.0)
        >>> of = Trajectory("gap", zero, one, two, Interval(-3.0, -4.0, -2.0))
        >>> warning(SimpleNamespace(closed_loop=(of,)))
        'In closed loop the extended model is worse: error of the gap 1 → 2 m rms, error variance +300 [+200, +400] %.'
    """
    lost = [of for of in report.closed_loop if worse(of)]
    if not lost:
        return ""
    parts = [f"{errors(of)}, error variance {change(of)}" for of in lost]
    sure = any(of.gain.high < 0 or math.isnan(of.gain.high) for of in lost)
    return (
        f"In closed loop the extended model is worse: error of the {'; of the '.join(parts)}"
        f"{'' if sure else ', which may be chance: the 95 % interval holds 0'}."
    )
