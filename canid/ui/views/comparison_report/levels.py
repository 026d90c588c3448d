"""A parameter over both drives next to each other, on one scale: smoothed level with its 95 % band."""

from __future__ import annotations

from markupsafe import Markup

from canid.analysis.comparison.comparison import Comparison
from canid.analysis.comparison.drive import Level
from canid.mathematics.identification.confidence import MISS
from canid.ui.views.document.document import Drawing
from canid.ui.views.drawing.level_panel import axes, level
from canid.ui.views.drawing.svg import Scale, scale, svg, text
from canid.values.text.names import label
from canid.values.text.numbers import number

WIDTH, HEIGHT, TOP, BOTTOM = 430.0, 190.0, 24.0, 28.0
LEFT, RIGHT = 56.0, 20.0
# drives of a side that are drawn
MAX_DRIVES = 3


def levels(comparison: Comparison) -> list[Drawing]:
    """Draw each parameter that both sides follow over a drive.

    Example:
        >>> from canid.analysis.comparison.drive import Side
        >>> levels(Comparison(Side("A", ()), Side("B", ()), "", (), (), (), (), 0.0, None))
        []
    """
    known = {
        side.label: [d for d in side.drives if d.levels][:MAX_DRIVES] for side in (comparison.a, comparison.b)
    }
    names = list(dict.fromkeys(v.name for side in known.values() for d in side for v in d.levels))
    units = {row.name: row.unit for row in comparison.rows}
    out = []
    for name in names:
        panels = [
            (kind, followed)
            for kind, side in zip(("a", "b"), known.values(), strict=True)
            for drive in side
            for followed in drive.levels
            if followed.name == name and len(followed.t) > 1
        ]
        if {kind for kind, _ in panels} == {"a", "b"}:
            unit = units.get(name, "")
            out.append(Drawing(_drawn(panels), f"{label(name)}{f', {unit}' if unit else ''}"))
    return out


def _drawn(panels: list[tuple[str, Level]]) -> Markup:
    """The drives next to each other, on one scale."""
    y = scale([x for _, drawn in panels for x in (*drawn.low, *drawn.high)], HEIGHT - BOTTOM, TOP)
    return Markup("") if y is None else Markup("").join(_panel(kind, drawn, y) for kind, drawn in panels)


def _panel(kind: str, drawn: Level, y: Scale) -> Markup:
    x = Scale(float(drawn.t[0]), float(drawn.t[-1]), LEFT, WIDTH - RIGHT)
    varies = "" if drawn.p_value >= MISS else ", varies"
    parts = [
        *axes(x, y, (5, 4)),
        *level(drawn.t, drawn.level, drawn.low, drawn.high, x, y, kind),
        text(f"{kind.upper()}{varies}", LEFT, 14, f"head {kind}"),
    ]
    alt = f"{label(drawn.name)} over {kind.upper()}, between {number(y.low)} and {number(y.high)}{varies}"
    return svg(parts, WIDTH, HEIGHT, alt)
