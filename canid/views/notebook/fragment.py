"""Parts of a fragment: tables and small drawings in the text's own color, so that light and dark pages both work.

Every text is escaped: names come from logs and vehicle files.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from canid.types import Array, Interval

# px
WIDTH, BAR_WIDTH, BAR_HEIGHT = 560, 150, 14
# points of a line: one per px would already be more than is seen
MAX_POINTS = 280
# readable on white and on black (contrast above 3 on both)
ACCENT, SECOND = "#3d85c6", "#c77d1e"
FAINT = "opacity:.65"


def fragment(title: str, *parts: str) -> str:
    """A fragment with its title; `parts` are HTML already."""
    return (
        f'<div class="canid" style="max-width:60em"><div><b>{escape(title)}</b></div>{"".join(parts)}</div>'
    )


def lines(texts: Iterable[str]) -> str:
    """Sentences, a line each."""
    return "".join(f'<div style="{FAINT}">{escape(text)}</div>' for text in texts if text)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; cells that begin with `<svg` are drawings of this module, all others are text.

    Example:
        >>> table(["role"], [["<script>"]]).count("&lt;script&gt;")
        1
    """
    cell = 'style="text-align:left;padding:1px 12px 1px 0;white-space:nowrap"'
    top = "".join(f"<th {cell}>{escape(name)}</th>" for name in head)
    body = "".join(
        "<tr>"
        + "".join(f"<td {cell}>{x if x.startswith('<svg ') else escape(x)}</td>" for x in row)
        + "</tr>"
        for row in rows
    )
    return (
        f'<table style="border-collapse:collapse"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>'
    )


def bar(of: Interval, low: float, high: float, says: str = "") -> str:
    """An interval on a scale from `low` to `high`; empty where there is no estimate."""
    if not all(map(math.isfinite, (of.value, of.low, of.high, low, high))) or not high > low:
        return ""

    def x(at: float) -> float:
        return 4 + (BAR_WIDTH - 8) * min(max((at - low) / (high - low), 0.0), 1.0)

    y = BAR_HEIGHT / 2
    size = f'viewBox="0 0 {BAR_WIDTH} {BAR_HEIGHT}" width="{BAR_WIDTH}" height="{BAR_HEIGHT}"'
    zero = f'<line x1="{x(0):.1f}" x2="{x(0):.1f}" y1="0" y2="{BAR_HEIGHT}" stroke="currentColor" opacity=".35"/>'
    parts = [
        f'<svg {size} role="img" aria-label="{escape(says, quote=True)}">',
        zero if low <= 0.0 <= high else "",
        f'<line x1="{x(of.low):.1f}" x2="{x(of.high):.1f}" y1="{y}" y2="{y}" stroke="{ACCENT}" ',
        'stroke-width="4" opacity=".55"/>',
        f'<circle cx="{x(of.value):.1f}" cy="{y}" r="3.5" fill="{ACCENT}"/></svg>',
    ]
    return "".join(parts)


def scale(intervals: Iterable[Interval]) -> tuple[float, float]:
    """One scale for several intervals, with 0 on it.

    Example:
        >>> scale([Interval(4.0, 3.0, 5.0), Interval()])
        (0.0, 5.0)
    """
    ends = [x for of in intervals for x in (of.low, of.high, of.value) if math.isfinite(x)]
    return min([0.0, *ends]), max([0.0, *ends])


def chart(
    t: Array,
    curves: Sequence[tuple[str, Array, str]],
    height: int = 90,
    shaded: Sequence[tuple[float, float]] = (),
) -> str:
    """Curves over time.

    Args:
        t: (n,) s.
        curves: name, values (n,), color.
        height: px.
        shaded: stretches in s that are marked.
    """
    values = np.concatenate([of[np.isfinite(of)] for _, of, _ in curves]) if curves else np.array([])
    if len(t) < 2 or not values.size:
        return ""
    low, high = float(values.min()), float(values.max())
    high = high if high > low else low + 1.0
    left, top, bottom = 52.0, 4.0, 16.0
    begin, span = float(t[0]), max(float(t[-1] - t[0]), 1e-9)

    def x(at: float) -> float:
        return left + (WIDTH - left - 4.0) * (at - begin) / span

    def y(at: float) -> float:
        return top + (height - top - bottom) * (1.0 - (at - low) / (high - low))

    parts = [
        f'<svg viewBox="0 0 {WIDTH} {height}" style="width:100%;max-width:{WIDTH}px" role="img" font-size="10" '
    ]
    says = "; ".join(name for name, _, _ in curves)
    parts[0] += f'font-family="sans-serif" aria-label="{escape(f"{says} over time", quote=True)}">'
    parts += [
        f'<rect x="{x(max(a, begin)):.1f}" width="{max(x(min(b, begin + span)) - x(max(a, begin)), 0.5):.1f}" y="{top}" '
        f'height="{height - top - bottom:.0f}" fill="currentColor" opacity=".10"/>'
        for a, b in shaded
    ]
    for text, at in ((f"{high:.3g}", top + 8), (f"{low:.3g}", height - bottom)):
        parts.append(
            f'<text x="{left - 6}" y="{at:.0f}" text-anchor="end" fill="currentColor">{escape(text)}</text>'
        )
    for at, anchor in ((begin, "start"), (begin + span, "end")):
        parts.append(
            f'<text x="{x(at):.0f}" y="{height - 3}" text-anchor="{anchor}" fill="currentColor">{at:.0f} s</text>'
        )
    for name, of, color in curves:
        parts += [
            f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.2">'
            f"<title>{escape(name)}</title></polyline>"
            for points in _polylines(t, of, x, y)
        ]
    return "".join([*parts, "</svg>"])


def legend(curves: Sequence[tuple[str, str]]) -> str:
    """Names in the colors of their curves."""
    return "".join(
        f'<span style="color:{color};padding-right:1em">— {escape(name)}</span>' for name, color in curves
    )


def _polylines(t: Array, values: Array, x: object, y: object) -> list[str]:
    """Stretches without a gap, thinned to the extremes of each bucket."""
    assert callable(x)
    assert callable(y)
    buckets = np.array_split(np.arange(len(t)), min(len(t), MAX_POINTS))
    out: list[list[str]] = [[]]
    for rows in buckets:
        here = rows[np.isfinite(values[rows])]
        if not here.size:
            out.append([])
            continue
        ends = sorted({int(here[np.argmin(values[here])]), int(here[np.argmax(values[here])])})
        out[-1] += [f"{x(float(t[k])):.1f},{y(float(values[k])):.1f}" for k in ends]
    return [" ".join(points) for points in out if len(points) > 1]
