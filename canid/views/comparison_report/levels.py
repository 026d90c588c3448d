"""A parameter over both drives next to each other, on one scale: smoothed level with its 95 % band."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from canid.comparison.comparison import Comparison
from canid.comparison.drive import DriveEstimates, Level
from canid.identification.confidence import MISS
from canid.views.comparison_report.drawing import element, points, svg, text
from canid.views.comparison_text import label
from canid.views.numbers import number

WIDTH, HEIGHT, TOP, BOTTOM = 430.0, 190.0, 24.0, 28.0
LEFT, RIGHT = 56.0, 8.0
# drives of a side that are drawn
MAX_DRIVES = 3


class Drawn(NamedTuple):
    """One parameter."""

    title: str
    svg: Markup


def levels(of: Comparison) -> list[Drawn]:
    """Draw each parameter that both sides follow over a drive.

    Example:
        >>> from canid.comparison.drive import Side
        >>> levels(Comparison(Side("A", ()), Side("B", ()), "", (), (), (), (), 0.0, None))
        []
    """
    known = {side.label: [d for d in side.drives if d.levels][:MAX_DRIVES] for side in (of.a, of.b)}
    names = list(dict.fromkeys(v.name for side in known.values() for d in side for v in d.levels))
    units = {row.name: row.unit for row in of.rows}
    out = []
    for name in names:
        panels = [
            (kind, drive, level)
            for kind, side in zip(("a", "b"), known.values(), strict=True)
            for drive in side
            for level in drive.levels
            if level.name == name and len(level.t) > 1
        ]
        if {kind for kind, _, _ in panels} == {"a", "b"}:
            unit = units.get(name, "")
            out.append(Drawn(f"{label(name)}{f', {unit}' if unit else ''}", _drawn(panels)))
    return out


def _drawn(panels: list[tuple[str, DriveEstimates, Level]]) -> Markup:
    low = min(float(np.min(level.low)) for _, _, level in panels)
    high = max(float(np.max(level.high)) for _, _, level in panels)
    low, high = (low, high) if high > low else (low - 1.0, high + 1.0)
    return Markup("").join(_panel(kind, level, low, high) for kind, _, level in panels)


def _panel(kind: str, level: Level, low: float, high: float) -> Markup:
    """One drive."""
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT

    def y(value: float) -> float:
        return bottom - (bottom - TOP) * (value - low) / (high - low)

    parts = []
    for value in np.linspace(low, high, 4):
        parts.append(element("line", "grid", x1=LEFT, x2=right, y1=y(value), y2=y(value)))
        parts.append(text(number(float(value)), LEFT - 6, y(float(value)) + 4, "tick", "end"))
    begin, end = float(level.t[0]), float(level.t[-1])
    x = LEFT + (right - LEFT) * (level.t - begin) / (end - begin)
    band = [*zip(x, map(y, level.low), strict=True), *reversed(list(zip(x, map(y, level.high), strict=True)))]
    parts.append(element("polygon", f"band {kind}", points=points(band)))
    parts.append(
        element("polyline", f"level {kind}", points=points(zip(x, map(y, level.level), strict=True)))
    )
    varies = "" if level.p_value >= MISS else ", varies"
    parts.append(text(f"{kind.upper()}{varies}", LEFT, 14, f"head {kind}"))
    parts.append(text(f"{begin:.0f} s", LEFT, bottom + 15, "tick"))
    parts.append(text(f"{end:.0f} s", right, bottom + 15, "tick", "end"))
    alt = f"{label(level.name)} over {kind.upper()}, between {number(low)} and {number(high)}{varies}"
    return svg(parts, WIDTH, HEIGHT, alt)
