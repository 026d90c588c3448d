"""A parameter over a drive as SVG: the smoothed level with its band, estimates of windows, changes."""

from __future__ import annotations

from collections.abc import Iterable

from markupsafe import Markup

from canid.ui.views.drawing.svg import Scale, element, points, text, ticks, time_ticks
from canid.values.text.numbers import number
from canid.values.types import Array


def axes(x: Scale, y: Scale, most: tuple[int, int] = (10, 5)) -> list[Markup]:
    """Grid lines at round values, and the ticks of both axes; `most`: ticks of the time and of the value."""
    parts = []
    for value in ticks(y.low, y.high, most[1]):
        parts.append(element("line", "grid", x1=x.start, x2=x.stop, y1=y(value), y2=y(value)))
        parts.append(text(number(value), x.start - 6, y(value) + 4, "tick", "end"))
    times = time_ticks(x.low, x.high, most[0])
    return parts + [text(f"{t:.0f} s", x(t), y.start + 15, "tick", "middle") for t in times]


def level(t: Array, middle: Array, low: Array, high: Array, x: Scale, y: Scale, kind: str) -> list[Markup]:
    """The band and the level; arrays (n,)."""
    edge = [*zip(t, high, strict=True), *reversed(list(zip(t, low, strict=True)))]
    return [
        element("polygon", f"band {kind}", points=points((x(a), y(b)) for a, b in edge)),
        element(
            "polyline", f"level {kind}", points=points((x(a), y(b)) for a, b in zip(t, middle, strict=True))
        ),
    ]


def windows(t: Array, value: Array, half: Array, x: Scale, y: Scale) -> list[Markup]:
    """Estimates of windows with their intervals, value ± half; arrays (n,)."""
    parts = []
    for at, v, h in zip(t, value, half, strict=True):
        parts.append(element("line", "window", x1=x(at), x2=x(at), y1=y(v - h), y2=y(v + h)))
        parts.append(element("circle", "window", cx=x(at), cy=y(v), r=2.5))
    return parts


def changes(at: Iterable[float], x: Scale, y: Scale) -> list[Markup]:
    """Dashed lines at the times of changes, s."""
    parts = []
    for t in at:
        parts.append(
            element("line", "change", x1=x(t), x2=x(t), y1=y.stop, y2=y.start, stroke_dasharray="5 3")
        )
        parts.append(text(f"{t:.0f} s", x(t) + 4, y.stop + 14, "change"))
    return parts
