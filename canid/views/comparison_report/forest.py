"""Forest plot of a comparison: both sides on a scale of their own row, and the differences in percent of A."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from canid.comparison.comparison import Row
from canid.types import Interval
from canid.views.comparison_report.drawing import element, svg, text
from canid.views.comparison_text import label

WIDTH, ROW, TOP, BOTTOM = 430.0, 34.0, 26.0, 26.0
# px from the left: names end; intervals lie between
NAMES, PLACE = 142.0, (156.0, 414.0)
# % of A to each side, at most: a longer interval ends with an arrow
MAX_PERCENT = 100.0
STEPS = (5.0, 10.0, 25.0, 50.0)


def forest(rows: Sequence[Row]) -> Markup:
    """Draw the compared rows, values and differences next to each other; empty where none is.

    Example:
        >>> str(forest(()))
        ''
    """
    if not rows:
        return Markup("")
    height = TOP + ROW * len(rows) + BOTTOM
    values = [text("A and B, each row on its own scale", PLACE[0], 14, "head"), *_names(rows)]
    for k, row in enumerate(rows):
        values += _values(row, _y(k))
    alt = "; ".join(
        f"{label(row.name)}: A {row.a.value:.3g}, B {row.b.value:.3g}{', differs' if row.differs else ''}"
        for row in rows
    )
    return svg(values, WIDTH, height, alt) + _differences(rows, height)


def _differences(rows: Sequence[Row], height: float) -> Markup:
    reach = _reach(rows)
    bottom = height - BOTTOM
    parts = [text("B less A, % of A", PLACE[0], 14, "head"), *_names(rows)]
    step = next((s for s in STEPS if reach / s <= 3.0), STEPS[-1])
    for k in range(-int(reach / step), int(reach / step) + 1):
        x = _at(k * step, -reach, reach, PLACE)
        parts.append(element("line", "zero" if k == 0 else "grid", x1=x, x2=x, y1=TOP, y2=bottom))
        parts.append(text(f"{k * step:+.0f}" if k else "0", x, bottom + 15, "tick", "middle"))
    for k, row in enumerate(rows):
        parts += _difference(row, _y(k), reach)
    alt = "; ".join(f"{label(row.name)}: difference {row.difference.value:.3g}" for row in rows)
    return svg(parts, WIDTH, height, alt)


def _names(rows: Sequence[Row]) -> list[str]:
    return [
        text(label(row.name), NAMES, _y(k) + 4, "differs" if row.differs else "name", "end")
        for k, row in enumerate(rows)
    ]


def _y(k: int) -> float:
    return TOP + ROW * (k + 0.5)


def _values(row: Row, y: float) -> list[str]:
    ends = [x for iv in (row.a, row.b) for x in iv if math.isfinite(x)]
    low, high = min(ends), max(ends)
    if not high > low:
        low, high = low - 1.0, high + 1.0
    return [
        part
        for iv, kind, up in ((row.a, "a", -5.0), (row.b, "b", 5.0))
        for part in _interval(iv, low, high, PLACE, y + up, kind)
    ]


def _difference(row: Row, y: float, reach: float) -> list[str]:
    own = _percent(row.difference, row.a.value)
    wide = _percent(row.together, row.a.value)
    if not all(map(math.isfinite, own)):
        return [text("A is 0", PLACE[0], y + 4, "tick")]
    kind = "found" if row.differs else "none"
    return [
        *_interval(wide, -reach, reach, PLACE, y, f"together {kind}", dot=False),
        *_interval(own, -reach, reach, PLACE, y, kind),
    ]


def _interval(
    iv: Interval,
    low: float,
    high: float,
    place: tuple[float, float],
    y: float,
    kind: str,
    *,
    dot: bool = True,
) -> list[str]:
    """A line and its value; an arrow where it ends outside."""
    a, b = (_at(min(max(x, low), high), low, high, place) for x in (iv.low, iv.high))
    parts = [element("line", kind, x1=a, x2=b, y1=y, y2=y)]
    if dot and low <= iv.value <= high:
        parts.append(element("circle", kind, cx=_at(iv.value, low, high, place), cy=y, r=3.5))
    for end, x, way in ((iv.low < low, a, 5.0), (iv.high > high, b, -5.0)):
        if end:
            parts.append(
                element(
                    "path",
                    kind,
                    d=f"M {x + way:.1f} {y - 4:.1f} L {x:.1f} {y:.1f} L {x + way:.1f} {y + 4:.1f}",
                )
            )
    return parts


def _percent(iv: Interval, of: float) -> Interval:
    if not of:
        return Interval()
    ends = sorted(100.0 * x / of for x in (iv.low, iv.high))
    return Interval(100.0 * iv.value / of, *ends)


def _reach(rows: Sequence[Row]) -> float:
    """% to each side: what nearly all intervals need."""
    ends = [abs(x) for row in rows for x in _percent(row.together, row.a.value) if math.isfinite(x)]
    return min(max(1.05 * max(ends, default=MAX_PERCENT), STEPS[0]), MAX_PERCENT)


def _at(x: float, low: float, high: float, place: tuple[float, float]) -> float:
    return place[0] + (place[1] - place[0]) * (x - low) / (high - low)
