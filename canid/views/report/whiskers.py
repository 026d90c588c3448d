"""Two intervals of one parameter, drawn small beside their numbers: static SVG, so that it needs no script."""

from __future__ import annotations

import math

from markupsafe import Markup

from canid.types import Interval
from canid.views.measures import decimals

# px
WIDTH, HEIGHT, EDGE = 150, 22, 6
# y of the line of each
LINES = (("before", 7), ("after", 15))


def whiskers(before: Interval, after: Interval) -> Markup:
    """Draw both intervals on one scale; empty where nothing is known.

    Example:
        >>> str(whiskers(Interval(), Interval()))
        ''
        >>> whiskers(Interval(1.0, 0.5, 2.0), Interval(2.0, 1.5, 2.5)).count("<circle")
        2
    """
    known = [x for iv in (before, after) for x in iv if math.isfinite(x)]
    if not known or min(known) == max(known):
        return Markup("")
    scale = (WIDTH - 2 * EDGE) / (max(known) - min(known))

    def at(x: float) -> str:
        return f"{EDGE + scale * (x - min(known)):.1f}"

    parts = []
    for (name, y), iv in zip(LINES, (before, after), strict=True):
        if math.isfinite(iv.low) and math.isfinite(iv.high):
            parts.append(f'<line class="{name}" x1="{at(iv.low)}" x2="{at(iv.high)}" y1="{y}" y2="{y}"/>')
        if math.isfinite(iv.value):
            parts.append(f'<circle class="{name}" cx="{at(iv.value)}" cy="{y}" r="3"/>')
    return Markup(
        f'<svg class="whiskers" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )


def shift(before: Interval, after: Interval) -> str:
    """Say how far a parameter has moved, and whether out of its former interval.

    Example:
        >>> shift(Interval(4.42, 3.58, 5.21), Interval(7.71, 6.6, 8.8))
        '+3.3 (+74 %), outside the former interval'
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
    return f"{moved:+.{digits}f}{share}, {'within' if inside else 'outside'} the former interval"
