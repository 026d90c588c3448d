"""Parts of a fragment: tables and small drawings in the text's own color, so that light and dark pages both work.

Every text is escaped: names come from logs and vehicle files.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from markupsafe import Markup

from canid.ui.views.document.document import Block
from canid.ui.views.document.templates import environment
from canid.ui.views.drawing import svg
from canid.ui.views.drawing.forest import plain_interval
from canid.ui.views.drawing.palette import NOTEBOOK
from canid.values.types import Array, Interval

# px
WIDTH = 560
# points of a line: one per px would already be more than is seen
MAX_POINTS = 280
ACCENT, SECOND = NOTEBOOK["after"], NOTEBOOK["before"]
INK, SHADE = "currentColor", ".10"


def fragment(title: str, *blocks: Block) -> Markup:
    """Blocks of a document below a title; a `Markup` is a drawing, or a fragment.

    Example:
        >>> from canid.ui.views.document.document import Table
        >>> fragment("a", Table(["role"], [["<script>"]])).count("&lt;script&gt;")
        1
    """
    return Markup(environment().get_template("document/notebook.html.j2").render(title=title, blocks=blocks))


def bar(drawn: Interval, low: float, high: float, says: str = "") -> Markup:
    """An interval on a scale from `low` to `high`; empty where there is no estimate."""
    return plain_interval(drawn, low, high, says, ACCENT)


def scale(intervals: Iterable[Interval]) -> tuple[float, float]:
    """One scale for several intervals, with 0 on it.

    Example:
        >>> scale([Interval(4.0, 3.0, 5.0), Interval()])
        (0.0, 5.0)
    """
    ends = [
        x for interval in intervals for x in (interval.low, interval.high, interval.value) if math.isfinite(x)
    ]
    return min([0.0, *ends]), max([0.0, *ends])


def chart(
    t: Array,
    curves: Sequence[tuple[str, Array, str]],
    height: int = 90,
    shaded: Sequence[tuple[float, float]] = (),
) -> Markup:
    """Curves over time.

    Args:
        t: (n,) s.
        curves: name, values (n,), color.
        height: px.
        shaded: stretches in s that are marked.
    """
    left, top, bottom = 52.0, 4.0, 16.0
    y = svg.scale((x for _, values, _ in curves for x in values), height - bottom, top)
    if len(t) < 2 or y is None:
        return Markup("")
    x = svg.Scale(float(t[0]), max(float(t[-1]), float(t[0]) + 1e-9), left, WIDTH - 4.0)
    parts = [
        svg.element(
            "rect", x=x(a), y=top, width=max(x(b) - x(a), 0.5), height=y.start - top, fill=INK, opacity=SHADE
        )
        for a, b in shaded
    ]
    for value, at in ((y.high, top + 8), (y.low, y.start)):
        parts.append(svg.text(f"{value:.3g}", left - 6, at, anchor="end", fill=INK))
    for time, anchor in ((x.low, "start"), (x.high, "end")):
        parts.append(svg.text(f"{time:.0f} s", x(time), height - 3, anchor=anchor, fill=INK))
    for name, values, color in curves:
        parts += [
            svg.element(
                "polyline",
                content=svg.element("title", content=name),
                points=points,
                fill="none",
                stroke=color,
                stroke_width="1.2",
            )
            for points in _polylines(t, values, x, y)
        ]
    says = f"{'; '.join(name for name, _, _ in curves)} over time"
    style = f"width:100%;max-width:{WIDTH}px;font:10px sans-serif"
    return svg.whole(parts, (WIDTH, height), says, style=style)


def charted(key: Sequence[tuple[str, str]], *drawings: Markup) -> Markup:
    """Drawings below the names of their curves, in the colors of these."""
    name = Markup('<span style="color:{1};padding-right:1em">— {0}</span>')
    names = Markup("").join(name.format(*curve) for curve in key)
    return Markup("<div>{}</div>").format(names + Markup("").join(drawings))


def _polylines(t: Array, values: Array, x: svg.Scale, y: svg.Scale) -> list[str]:
    """Points of stretches without a gap, thinned to the extremes of each bucket."""
    out: list[list[tuple[float, float]]] = [[]]
    for rows in np.array_split(np.arange(len(t)), min(len(t), MAX_POINTS)):
        here = rows[np.isfinite(values[rows])]
        if not here.size:
            out.append([])
            continue
        ends = sorted({int(here[np.argmin(values[here])]), int(here[np.argmax(values[here])])})
        out[-1] += [(x(float(t[k])), y(float(values[k]))) for k in ends]
    return [svg.points(stretch) for stretch in out if len(stretch) > 1]
