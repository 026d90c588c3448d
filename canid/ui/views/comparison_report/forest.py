"""Forest plot of a comparison: both sides on a scale of their own row, and the differences in percent of A."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from canid.analysis.comparison.comparison import Row
from canid.ui.views.drawing.forest import interval_line
from canid.ui.views.drawing.svg import Scale, element, scale, svg, text, ticks
from canid.values.text.names import label
from canid.values.text.numbers import UNIT_SYMBOLS, number
from canid.values.types import Interval

WIDTH, ROW, TOP, BOTTOM = 430.0, 34.0, 26.0, 26.0
# px from the left: names end; intervals lie between
NAMES, PLACE = 142.0, (156.0, 414.0)
# px for the numbers at both ends of a row's scale, the higher with its unit
LOW_END, HIGH_END = 40.0, 74.0
# % of A to each side, at least and at most: a longer interval ends with an arrow
MIN_PERCENT, MAX_PERCENT = 5.0, 100.0


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
    at, bottom = Scale(-reach, reach, *PLACE), height - BOTTOM
    parts = [text("B less A, % of A", PLACE[0], 14, "head"), *_names(rows)]
    for value in ticks(-reach, reach, 7):
        x = at(value)
        parts.append(element("line", "grid" if value else "zero", x1=x, x2=x, y1=TOP, y2=bottom))
        parts.append(text(f"{value:+.0f}" if value else "0", x, bottom + 15, "tick", "middle"))
    for k, row in enumerate(rows):
        parts += _difference(row, _y(k), at)
    alt = "; ".join(f"{label(row.name)}: difference {row.difference.value:.3g}" for row in rows)
    return svg(parts, WIDTH, height, alt)


def _names(rows: Sequence[Row]) -> list[Markup]:
    return [
        text(label(row.name), NAMES, _y(k) + 4, "differs" if row.differs else "name", "end")
        for k, row in enumerate(rows)
    ]


def _y(k: int) -> float:
    return TOP + ROW * (k + 0.5)


def _values(row: Row, y: float) -> list[Markup]:
    """Both intervals between the ends of the row's own scale, which stand in front of and behind them."""
    at = scale([*row.a, *row.b], PLACE[0] + LOW_END, PLACE[1] - HIGH_END)
    if at is None:
        return []
    unit = f" {UNIT_SYMBOLS.get(row.unit, row.unit)}" if row.unit else ""
    return [
        element("line", "grid", x1=at.start, x2=at.stop, y1=y, y2=y),
        text(number(at.low), at.start - 6, y + 4, "tick", "end"),
        text(f"{number(at.high)}{unit}", at.stop + 6, y + 4, "tick"),
        *interval_line(row.a, at, y - 5, "a"),
        *interval_line(row.b, at, y + 5, "b"),
    ]


def _difference(row: Row, y: float, at: Scale) -> list[Markup]:
    difference = _percent(row.difference, row.a.value)
    if not all(map(math.isfinite, difference)):
        return [text("A is 0", PLACE[0], y + 4, "tick")]
    kind = "found" if row.differs else "none"
    wide = _percent(row.together, row.a.value)
    return [
        *interval_line(wide, at, y, f"together {kind}", radius=0),
        *interval_line(difference, at, y, kind),
    ]


def _percent(iv: Interval, whole: float) -> Interval:
    if not whole:
        return Interval()
    ends = sorted(100.0 * x / whole for x in (iv.low, iv.high))
    return Interval(100.0 * iv.value / whole, *ends)


def _reach(rows: Sequence[Row]) -> float:
    """% to each side: what nearly all intervals need."""
    ends = [abs(x) for row in rows for x in _percent(row.together, row.a.value) if math.isfinite(x)]
    return min(max(1.05 * max(ends, default=MAX_PERCENT), MIN_PERCENT), MAX_PERCENT)
