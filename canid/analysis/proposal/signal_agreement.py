"""How signals on the raster of a log agree: derivatives, correlations, and the roles with which others are compared."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.analysis.proposal.log_columns import STEP_S
from canid.analysis.proposal.name_score import Candidate
from canid.signals.vehicle.units import factor_to
from canid.values.roles import ROLES
from canid.values.types import Array

# points, in the same unit as those of names: a clear agreement outweighs a unit, a contradiction a name
AGREES, AGREES_WEAKLY, CONTRADICTS, STILL = 3.0, 1.0, -6.0, -1.5
# s over which derivatives are taken: a radar's quantisation of 0.1 m and a speed's of 0.1 km/h are small in it
_SLOPE_S = 1.0
# rows (of 0.1 s) without which nothing is said
MIN_ROWS = 50


class References(NamedTuple):
    """Roles that are known already, on the raster, in canid's units; NaN: not measured."""

    wheels: Array | None = None  # m/s, or of unknown unit
    wheels_unit: bool = False
    wheels_are: str = "the wheel speeds"  # what is said of them
    speed: Array | None = None
    accel: Array | None = None  # derivative of `speed`, m/s2
    pedal: Array | None = None
    cruise: Array | None = None
    steering: Array | None = None
    gap_rate: Array | None = None


# points, remarks, the candidate with what the log adds to it
Judged = tuple[float, list[str], Candidate]


def in_role_unit(candidate: Candidate, raw: Array) -> Array:
    """Values of the DBC as the vehicle file would convert them."""
    unit = ROLES[candidate.role].unit
    if ROLES[candidate.role].kind == "bool":
        on = np.isin(raw, candidate.on) if candidate.on is not None else raw != 0
        return np.where(np.isfinite(raw), on.astype(float), np.nan)
    factor = factor_to(candidate.unit, unit) if unit and candidate.unit else None
    return raw * candidate.scale * (factor if factor is not None else 1.0)


def slope(values: Array) -> Array:
    """Derivative over one second; NaN at the ends and where something was not measured.

    Example:
        >>> slope(0.1 * np.arange(30.0))[10:12].round(3).tolist()
        [1.0, 1.0]
    """
    half = round(_SLOPE_S / STEP_S / 2)
    made = np.full(len(values), np.nan)
    if len(values) > 2 * half:
        made[half:-half] = (values[2 * half :] - values[: -2 * half]) / (2 * half * STEP_S)
    return made


def correlation(a: Array, b: Array) -> tuple[float, float, int]:
    """Correlation, slope of `a` on `b` through the mean, and rows; NaN where they do not move together in enough rows."""
    both = np.isfinite(a) & np.isfinite(b)
    n = int(both.sum())
    if n < MIN_ROWS:
        return math.nan, math.nan, n
    x, y = b[both] - b[both].mean(), a[both] - a[both].mean()
    xx, yy = float(x @ x), float(y @ y)
    if xx <= 1e-12 * n or yy <= 1e-12 * n:
        return math.nan, math.nan, n
    return float(x @ y) / math.sqrt(xx * yy), float(x @ y) / xx, n


def moves(raw: Array) -> bool:
    """Whether a signal has more than one value."""
    finite = raw[np.isfinite(raw)]
    return len(finite) > 1 and float(np.ptp(finite)) > 0.0


def smooth(raw: Array) -> Array:
    """Mean over the second of `slope`."""
    width = round(_SLOPE_S / STEP_S)
    ok = np.isfinite(raw)
    total = np.convolve(np.where(ok, raw, 0.0), np.ones(width), "same")
    count = np.convolve(ok.astype(float), np.ones(width), "same")
    return np.where(count > width / 2, total / np.maximum(count, 1), np.nan)
