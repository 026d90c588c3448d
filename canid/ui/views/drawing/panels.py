"""Panels one below the other over the time of the log: lines, bands, marks and a shared axis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.ui.views.drawing.decimation import min_max_indices
from canid.ui.views.drawing.figure import (
    MARGIN_PX,
    NARROW_MARGIN_PX,
    Figure,
    Spec,
    annotation,
    axis,
    axis_suffix,
    layout,
    line,
    once,
    times,
    to_list,
)
from canid.values.runs import runs
from canid.values.text.names import readable
from canid.values.types import Array

# px of a panel's title, and between two panels
TITLE_PX, GAP_PX = 20, 30
# px of a figure on a phone and on A4, of a legend's entry without its text, and of a character at 11 px
PHONE_PX, PAPER_PX, ENTRY_PX, CHARACTER_PX = 360.0, 680.0, 40.0, 5.4
# share of the points, on both sides, that a panel's range need not show: the first intervals are as wide as the search
OUTSIDE = 0.02
# of a panel's range, on both sides
SPARE = 0.08


class Panel(NamedTuple):
    """One panel."""

    title: str  # quantity and unit
    data: list[Spec]  # without axes, which `stack` gives them
    height: int = 120  # px
    range: tuple[float, float] | None = None
    more: Mapping[str, Any] = {}  # of the ordinate


def stack(
    name: str,
    title: str,
    caption: str,
    panels: Sequence[Panel],
    *,
    span: tuple[float, float] | None = None,
    shapes: Iterable[Spec] = (),
    annotations: Iterable[Spec] = (),
) -> Figure:
    """Panels of one figure with a common time axis; the alternative text lists them.

    Args:
        name: id in the page.
        title: of the figure.
        caption: what to see in it.
        panels: from above to below.
        span: s, of the time axis.
        shapes: behind the lines, with `xref` "x" and `yref` "paper".
        annotations: texts on the figure.

    Example:
        >>> of = stack("a", "", "", [Panel("gap (m)", []), Panel("speed (m/s)", [])])
        >>> of.layout["yaxis"]["domain"][1], of.layout["yaxis2"]["domain"][0], of.alt
        (1.0, 0.0, 'Panels over time: gap (m); speed (m/s)')
    """
    total = sum(panel.height for panel in panels) + GAP_PX * (len(panels) - 1)
    behind = list(shapes)
    data: list[Spec] = []
    axes: Spec = {}
    titles: list[Spec] = []
    top = 0
    for k, panel in enumerate(panels):
        low, high = 1.0 - (top + panel.height) / total, 1.0 - top / total
        top += panel.height + GAP_PX
        domain = [max(round(low, 6), 0.0), round(high, 6)]
        limits: Spec = {} if panel.range is None else {"range": list(panel.range)}
        axes[f"yaxis{axis_suffix(k)}"] = axis(
            "", domain=domain, **({"nticks": 5, "automargin": "left"} | limits | dict(panel.more))
        )
        font = {"size": 11, "color": "@ink"}
        titles.append(annotation(panel.title, 0.0, domain[1], xanchor="left", yanchor="bottom", font=font))
        data += [spec | {"xaxis": "x", "yaxis": f"y{axis_suffix(k)}"} for spec in panel.data]
    data = once(data)
    bottom = f"y{axis_suffix(len(panels) - 1)}"
    limits = {} if span is None else {"range": list(span)}
    axes["xaxis"] = axis("time in the log (s)", anchor=bottom, domain=[0, 1], hoverformat=".1f", **limits)
    # the first title stands between legend and panel
    names = [spec["name"] for spec in data if spec["showlegend"]] + [
        spec["name"] for spec in behind if "name" in spec
    ]
    margin_top = (max(MARGIN_PX["t"], legend_px(names, PAPER_PX)) if names else 0) + TITLE_PX
    height = total + margin_top + MARGIN_PX["b"]
    narrow_top = legend_px(names) + TITLE_PX
    wide, narrow = (
        margins | {"l": left, "t": above}
        for margins, left, above in ((MARGIN_PX, 56, margin_top), (NARROW_MARGIN_PX, 42, narrow_top))
    )
    return Figure(
        name,
        title,
        caption,
        f"Panels over time: {'; '.join(panel.title for panel in panels)}",
        height,
        data,
        layout(
            axes, shapes=behind, annotations=[*titles, *annotations], hovermode="x", margin=wide, meta="time"
        ),
        (height - margin_top + narrow_top, {"margin": narrow}),
    )


def legend_px(names: Sequence[str], width: float = PHONE_PX) -> int:
    """Height of a legend, on a phone by default, whose entries stand in columns as wide as the longest.

    Example:
        >>> legend_px([]), legend_px(["measured"]), legend_px(["measured", "simulated from the inputs alone"])
        (0, 29, 51)
    """
    if not names:
        return 0
    across = max(int(width // (ENTRY_PX + CHARACTER_PX * max(map(len, names)))), 1)
    return 7 + 22 * -(-len(names) // across)


def signal(
    t: Array,
    y: Array,
    name: str,
    color: str,
    most: int,
    keep: npt.NDArray[np.bool_] | None = None,
    **more: Any,
) -> Spec:
    """A measured or simulated line, thinned to the extremes of each bucket; samples of `keep` are all drawn."""
    at = min_max_indices(y, np.zeros(len(y), dtype=bool) if keep is None else keep, most)
    return line(times(t[at]), y[at], name, color, **more)


def band(t: Array, low: Array, high: Array, name: str, color: str) -> Spec:
    """A 95 % band as polygons, one per stretch in which both ends are known.

    Example:
        >>> nan = float("nan")
        >>> t = np.arange(5.0)
        >>> one = band(t, np.array([0.0, 1.0, nan, 2.0, 3.0]), np.array([4.0, 5.0, nan, 6.0, 7.0]), "b", "after")
        >>> one["x"]
        [0.0, 1.0, 1.0, 0.0, 0.0, None, 3.0, 4.0, 4.0, 3.0, 3.0, None]
    """
    x: list[float | None] = []
    y: list[float | None] = []
    for a, b in runs(np.isfinite(low) & np.isfinite(high)):
        there = times(t[a:b])
        x += [*there, *there[::-1], there[0], None]
        edge = to_list(high[a:b]) + to_list(low[a:b])[::-1]
        y += [*edge, edge[0], None]
    return {
        "type": "scatter", "mode": "lines", "x": x, "y": y, "fill": "toself", "fillcolor": f"@{color}", "opacity": 0.2,
        "line": {"width": 0, "color": f"@{color}"}, "name": name, "legendgroup": name, "hoverinfo": "skip",
    }  # fmt: skip


def shown_range(values: Iterable[Array]) -> tuple[float, float] | None:
    """The range of a panel that shows all but the outermost points; None: nothing is known.

    Example:
        >>> low, high = shown_range([np.append(np.linspace(0.0, 1.0, 101), 1e6)])
        >>> low < 0.1 and 0.9 < high < 2.0
        True
    """
    every = np.concatenate([np.zeros(0), *values])
    every = every[np.isfinite(every)]
    if not every.size:
        return None
    low, high = (float(x) for x in np.quantile(every, (OUTSIDE, 1.0 - OUTSIDE)))
    spare = SPARE * (high - low) or max(abs(high), 1.0) * SPARE
    return low - spare, high + spare


def shade(t: Array, flags: npt.NDArray[np.bool_], step: float, name: str, color: str) -> list[Spec]:
    """Stretches in which a flag is set, behind the lines."""
    return shade_spans([(float(t[a]), float(t[b - 1]) + step) for a, b in runs(flags)], name, color)


def shade_spans(spans: Sequence[tuple[float, float]], name: str, color: str) -> list[Spec]:
    """Stretches behind the lines as one shape with an entry in the legend: hundreds of shapes are slow.

    Example:
        >>> shade_spans([(0.0, 1.0), (2.0, 3.0)], "masked", "bar")[0]["path"]
        'M0.000,0V1H1.000V0Z M2.000,0V1H3.000V0Z'
    """
    if not spans:
        return []
    path = " ".join(f"M{a:.3f},0V1H{b:.3f}V0Z" for a, b in spans)
    return [{
        "type": "path", "path": path, "xref": "x", "yref": "paper", "layer": "below", "fillcolor": f"@{color}",
        "line": {"width": 0}, "name": name, "showlegend": True,
    }]  # fmt: skip


def titled(name: str, unit: str) -> str:
    """Title of a panel: quantity and unit; names are data, which plotly would read as markup.

    Example:
        >>> titled("range_rate", "m/s"), titled("<b>", "")
        ('range rate (m/s)', '&lt;b&gt;')
    """
    words = escape(readable(name), quote=False)
    return f"{words} ({unit})" if unit else words


def instants(at: Iterable[tuple[float, str]], color: str) -> tuple[list[Spec], list[Spec]]:
    """Vertical lines with a text above: shapes and annotations."""
    rows = list(at)
    shapes: list[Spec] = [
        {
            "type": "line", "x0": t, "x1": t, "y0": 0, "y1": 1, "xref": "x", "yref": "paper",
            "line": {"color": f"@{color}", "width": 1.2, "dash": "dash"},
        }
        for t, _ in rows
    ]  # fmt: skip
    texts: list[Spec] = [
        {
            "text": text, "x": t, "y": 1.0, "xref": "x", "yref": "paper", "showarrow": False, "xanchor": "left",
            "yanchor": "top", "font": {"size": 11, "color": f"@{color}"},
        }
        for t, text in rows
    ]  # fmt: skip
    return shapes, texts
