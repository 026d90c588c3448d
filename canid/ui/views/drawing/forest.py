"""Forest plots: estimates with their intervals as lines and dots on a scale."""

from __future__ import annotations

import math

from markupsafe import Markup

from canid.ui.views.drawing.svg import Scale, element, scale, small, text, ticks
from canid.values.text.numbers import number
from canid.values.types import Interval


def interval_line(
    iv: Interval, at: Scale, y: float, kind: str, *, radius: float = 3.5, arrow: float = 5.0
) -> list[Markup]:
    """A line with a dot at the value; an arrow where the interval ends outside of the scale.

    Args:
        iv: unknown ends are not drawn.
        at: the abscissa.
        y: px.
        kind: class of the style sheet.
        radius: px of the dot; 0: none.
        arrow: px.

    Example:
        >>> print(*interval_line(Interval(1.0, 0.0, 2.0), Scale(0.0, 2.0, 0.0, 10.0), 5.0, "a"))
        <line class="a" x1="0" x2="10" y1="5" y2="5"/> <circle class="a" cx="5" cy="5" r="3.5"/>
    """
    parts = []
    ends = math.isfinite(iv.low) and math.isfinite(iv.high)
    if ends:
        parts.append(element("line", kind, x1=at(iv.low), x2=at(iv.high), y1=y, y2=y))
    if radius and at.low <= iv.value <= at.high:
        parts.append(element("circle", kind, cx=at(iv.value), cy=y, r=radius))
    # of an interval that lies outside as a whole the arrow alone is seen
    for outside, value, way in ((iv.low < at.low, iv.low, arrow), (iv.high > at.high, iv.high, -arrow)):
        if ends and outside:
            x, tall = at(value), 0.8 * arrow
            path = f"M {x + way:.1f} {y - tall:.1f} L {x:.1f} {y:.1f} L {x + way:.1f} {y + tall:.1f}"
            parts.append(element("path", kind, d=path))
    return parts


def value_axis(at: Scale, top: float, bottom: float) -> list[Markup]:
    """Grid lines and ticks below."""
    parts = []
    for value in ticks(at.low, at.high):
        parts.append(element("line", "grid", x1=at(value), x2=at(value), y1=top, y2=bottom))
        parts.append(text(number(value), at(value), bottom + 15, "tick", "middle"))
    return parts


def two_intervals(before: Interval, after: Interval) -> Markup:
    """The intervals of one parameter in two models, for a cell of a table; empty where nothing is known.

    Example:
        >>> str(two_intervals(Interval(), Interval()))
        ''
        >>> two_intervals(Interval(1.0, 0.5, 2.0), Interval(2.0, 1.5, 2.5)).count("<circle")
        2
    """
    width, height, edge = 150.0, 22.0, 6.0
    known = {x for x in (*before, *after) if math.isfinite(x)}
    at = scale(known, edge, width - edge)
    if at is None or len(known) < 2:
        return Markup("")
    parts = [
        *interval_line(before, at, 7.0, "before", radius=3.0),
        *interval_line(after, at, 15.0, "after", radius=3.0),
    ]
    return small(parts, width, height, kind="forest-plot")


def plain_interval(iv: Interval, low: float, high: float, alt: str, color: str) -> Markup:
    """An interval between `low` and `high` without a style sheet, for a table in a notebook; empty where unknown.

    Example:
        >>> "<line" in plain_interval(Interval(1.0, 0.5, 2.0), 0.0, 3.0, "1.0 [0.5, 2.0]", "#3d85c6")
        True
    """
    width, height = 150.0, 14.0
    if not all(map(math.isfinite, (*iv, low, high))) or not high > low:
        return Markup("")
    at, y = Scale(low, high, 4.0, width - 4.0), height / 2
    parts = [
        element(
            "line", x1=at(iv.low), x2=at(iv.high), y1=y, y2=y, stroke=color, stroke_width=4, opacity=".55"
        ),
        element("circle", cx=at(iv.value), cy=y, r=3.5, fill=color),
    ]
    if low <= 0.0 <= high:
        zero = at(0.0)
        parts.insert(
            0, element("line", x1=zero, x2=zero, y1=0, y2=height, stroke="currentColor", opacity=".35")
        )
    return small(parts, width, height, alt)
