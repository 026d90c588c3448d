"""Under which conditions each side was identified, and where they differ so much that they may be the reason."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.analysis.comparison.drive import DriveEstimates, Side
from canid.values.types import NAN, Interval

# of the narrower range, the share that both sides drove: below it the driver was seen at two operating points
MIN_OVERLAP = 0.25
# ratio of two excitations from which on one side knows much less
MAX_EXCITATION_RATIO = 3.0
UNITS = {"speed": "m/s", "headway": "s", "gap": "m"}
INPUT_UNITS = {"headway_error": "s", "range_rate": "m/s", "lateral_offset": "m"}


class Condition(NamedTuple):
    """One condition on both sides."""

    name: str  # "speed", "headway", "gap", "used", "excitation range_rate"
    unit: str
    a: Interval  # of a range: median, and the 5 and 95 % points; else a value
    b: Interval
    overlap: float = NAN  # share of the narrower range that both drove


def table(a: Side, b: Side) -> tuple[Condition, ...]:
    """Conditions that are known of one side at least.

    >>> first, other = (Side(name, (DriveEstimates(name, "identify", "car", "pedal", 60.0, {},
    ...     {"speed": Interval(x, x - 2, x + 2)}),)) for name, x in (("A", 10.0), ("B", 20.0)))
    >>> [(c.name, c.overlap) for c in table(first, other)]
    [('used', nan), ('speed', 0.0)]
    """
    used = [Interval(sum(drive.used for drive in side.drives)) for side in (a, b)]
    out = [Condition("used", "s", used[0], used[1])]
    for role, unit in UNITS.items():
        ranges = [_range(side.drives, role) for side in (a, b)]
        if any(math.isfinite(interval.value) for interval in ranges):
            out.append(Condition(role, unit, ranges[0], ranges[1], _overlap(*ranges)))
    for name in dict.fromkeys(name for side in (a, b) for drive in side.drives for name in drive.excitation):
        sizes = [Interval(_root_mean_square(side.drives, name)) for side in (a, b)]
        out.append(Condition(f"excitation {name}", INPUT_UNITS.get(name, ""), sizes[0], sizes[1]))
    return tuple(out)


def warnings(rows: Sequence[Condition], a: Side, b: Side) -> list[str]:
    """Sentences on conditions that may be the reason for a difference, or for none."""
    out = []
    for row in rows:
        if row.overlap < MIN_OVERLAP:
            out.append(
                f"the operating point differs: the ranges of {row.name} hardly overlap "
                f"({row.a.low:.3g} to {row.a.high:.3g} {row.unit} and {row.b.low:.3g} to {row.b.high:.3g} {row.unit}); "
                f"gains that depend on {row.name} may be the reason for a difference"
            )
        if row.name.startswith("excitation"):
            sizes = sorted((row.a.value, row.b.value))
            if math.isfinite(sum(sizes)) and sizes[1] > MAX_EXCITATION_RATIO * sizes[0]:
                quiet = "A" if row.a.value < row.b.value else "B"
                out.append(
                    f"{row.name.removeprefix('excitation ').replace('_', ' ')} moved {sizes[1] / max(sizes[0], 1e-9):.1f} "
                    f"times less in {quiet}, which therefore knows less"
                )
    return out


def _range(drives: Sequence[DriveEstimates], role: str) -> Interval:
    known = [drive.driven[role] for drive in drives if role in drive.driven]
    known = [interval for interval in known if all(map(math.isfinite, interval))]
    if not known:
        return Interval()
    return Interval(
        float(np.mean([interval.value for interval in known])),
        min(interval.low for interval in known),
        max(interval.high for interval in known),
    )


def _overlap(a: Interval, b: Interval) -> float:
    narrower = min(a.high - a.low, b.high - b.low)
    if not narrower > 0.0:
        return NAN
    return max(min(a.high, b.high) - max(a.low, b.low), 0.0) / narrower


def _root_mean_square(drives: Sequence[DriveEstimates], name: str) -> float:
    known = [
        drive.excitation[name] for drive in drives if math.isfinite(drive.excitation.get(name, math.nan))
    ]
    return float(np.sqrt(np.mean(np.square(known)))) if known else NAN
