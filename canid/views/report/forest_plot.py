"""Forest plot: the intervals of one parameter in both models, as a small static SVG that needs no script."""

from __future__ import annotations

import math

from markupsafe import Markup

from canid.types import Interval
from canid.views.numbers import decimals

WIDTH_PX, HEIGHT_PX, EDGE_PX = 150, 22, 6
# class of the style sheet, and y of the interval in px
ROWS = (("before", 7), ("after", 15))


def forest_plot(before: Interval, after: Interval) -> Markup:
    """Both intervals on one scale; empty where nothing is known.

    Example:
        >>> str(forest_plot(Interval(), Interval()))
        ''
        >>> forest_plot(Interval(1.0, 0.5, 2.0), Interval(2.0, 1.5, 2.5)).count("<circle")
        2
    """
    known = [x for iv in (before, after) for x in iv if math.isfinite(x)]
    if not known or min(known) == max(known):
        return Markup("")
    scale = (WIDTH_PX - 2 * EDGE_PX) / (max(known) - min(known))

    def at(x: float) -> str:
        return f"{EDGE_PX + scale * (x - min(known)):.1f}"

    parts = []
    for (name, y), iv in zip(ROWS, (before, after), strict=True):
        if math.isfinite(iv.low) and math.isfinite(iv.high):
            parts.append(f'<line class="{name}" x1="{at(iv.low)}" x2="{at(iv.high)}" y1="{y}" y2="{y}"/>')
        if math.isfinite(iv.value):
            parts.append(f'<circle class="{name}" cx="{at(iv.value)}" cy="{y}" r="3"/>')
    return Markup(
        f'<svg class="forest-plot" width="{WIDTH_PX}" height="{HEIGHT_PX}" '
        f'viewBox="0 0 {WIDTH_PX} {HEIGHT_PX}" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )


def shift(before: Interval, after: Interval) -> str:
    """How far the extended model moves a parameter, and whether out of the baseline's interval.

    Example:
        >>> shift(Interval(4.42, 3.58, 5.21), Interval(7.71, 6.6, 8.8))
        '+3.3 (+74 %), outside the baseline interval'
        >>> shift(Interval(), Interval(7.71, 6.6, 8.8))
        '–'
    """
    if not (math.isfinite(before.value) and math.isfinite(after.value)):
        return "–"
    digits = max(decimals(before), decimals(after))
    by = after.value - before.value
    moved = round(by, digits) + 0.0  # no "-0.0"
    share = f" ({100 * by / abs(before.value):+.0f} %)" if moved and before.value else ""
    inside = before.low <= after.value <= before.high
    return f"{moved:+.{digits}f}{share}, {'within' if inside else 'outside'} the baseline interval"
