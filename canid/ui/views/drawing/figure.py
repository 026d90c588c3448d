"""Figure specifications: data and layout as plotly takes them, with caption and alternative text.

Colors are names such as `"@before"`; the page's script replaces them by those of the style sheet for light, dark and
print.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.values.text.numbers import same_digits
from canid.values.types import Array

Spec = dict[str, Any]

# px that a figure leaves for its axes: left, right, top (legend), bottom
MARGIN_PX = {"l": 62, "r": 18, "t": 34, "b": 44}
# the same on a phone
NARROW_MARGIN_PX = {"l": 46, "r": 8, "t": 34, "b": 40}
# significant digits of plotted values: a screen has some 2,000 px, which is 4 digits
PLOT_DIGITS = 5


class Figure(NamedTuple):
    """One figure."""

    name: str  # id in the page
    title: str
    caption: str  # what to see in it
    alt: str  # alternative text: what it shows
    height: int = 0  # px
    data: Sequence[Spec] = ()
    layout: Mapping[str, Any] = {}
    narrow: tuple[int, Spec] | None = None  # on a phone: height in px, and what replaces keys of the layout


def script(figures: Sequence[Figure]) -> str:
    r"""Figures as JSON for a script element of the page.

    Example:
        >>> script([Figure("a", "", "", "", 100, [{"x": [1.0], "name": "</script>"}], {})])
        '{"a": {"height": 100, "data": [{"x": [1.0], "name": "\\u003c/script>"}], "layout": {}}}'
    """
    specs = {f.name: {"height": f.height, "data": f.data, "layout": f.layout} for f in figures}
    for f in figures:
        if f.narrow is not None:
            specs[f.name]["narrow"] = {"height": f.narrow[0], "layout": f.narrow[1]}
    return json.dumps(specs, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def to_list(array: Array) -> list[Any]:
    """An array as nested lists for JSON: five significant digits after those that all values share, null for NaN.

    Example:
        >>> to_list(np.array([[0.1234567, np.nan]])), to_list(np.array([46.870512, 46.870534]))
        ([[0.12346, None]], [46.870512, 46.870534])
    """
    if array.ndim > 1:
        return [to_list(row) for row in array]
    known = array[np.isfinite(array)]
    digits = PLOT_DIGITS + (same_digits(float(known.min()), float(known.max())) if len(known) else 0)
    return [float(f"{x:.{digits}g}") if math.isfinite(x) else None for x in array.tolist()]


def times(t: Array) -> list[float]:
    """Times rounded to a millisecond, however late in the log.

    Example:
        >>> times(np.array([35999.1004]))
        [35999.1]
    """
    return [round(x, 3) for x in t.tolist()]


def line(
    x: list[Any], y: Array, name: str, color: str, *, axes: tuple[str, str] = ("x", "y"), **more: Any
) -> Spec:
    """A line. Lines of the same name share one entry in the legend, which hides and shows them together."""
    return {
        "type": "scatter", "mode": "lines", "x": x, "y": to_list(y), "name": name, "legendgroup": name,
        "xaxis": axes[0], "yaxis": axes[1], "line": {"color": f"@{color}", "width": 1.2}, **more,
    }  # fmt: skip


def once(data: Sequence[Spec]) -> list[Spec]:
    """Lines of several panels with one entry in the legend per name.

    Example:
        >>> [one["showlegend"] for one in once([{"name": "a"}, {"name": "a"}, {"name": "b", "showlegend": False}])]
        [True, False, False]
    """
    first = {spec.get("name", ""): k for k, spec in reversed(list(enumerate(data)))}
    return [
        spec | {"showlegend": first[spec.get("name", "")] == k and spec.get("showlegend", "name" in spec)}
        for k, spec in enumerate(data)
    ]


def axis(title: str = "", **more: Any) -> Spec:
    """An axis in the style of the page."""
    return {
        "title": {"text": title, "standoff": 6, "font": {"size": 12}}, "gridcolor": "@grid", "zeroline": False,
        "linecolor": "@rule", "showline": True, "ticks": "outside", "ticklen": 3, "tickcolor": "@rule", **more,
    }  # fmt: skip


def layout(axes: Mapping[str, Spec], **more: Any) -> Spec:
    """The layout that all figures share: legend above, no title, colors of the page."""
    return {
        "margin": dict(MARGIN_PX), "paper_bgcolor": "@page", "plot_bgcolor": "rgba(0,0,0,0)", "hovermode": "closest",
        "font": {"family": "system-ui, 'Segoe UI', 'DejaVu Sans', sans-serif", "size": 12, "color": "@ink"},
        "hoverlabel": {"bgcolor": "@panel", "bordercolor": "@rule", "font": {"color": "@ink"}},
        "legend": {"orientation": "h", "font": {"size": 11}, "x": 0, "xanchor": "left", "xref": "container",
                   "y": 1, "yanchor": "top", "yref": "container"},
        "dragmode": "zoom", **axes, **more,
    }  # fmt: skip


def equal_domains(count: int, gap: float) -> list[tuple[float, float]]:
    """Equal domains of axes between 0 and 1, with a gap between neighbours.

    Example:
        >>> equal_domains(2, 0.1)
        [(0.0, 0.45), (0.55, 1.0)]
    """
    width = (1.0 - gap * (count - 1)) / count
    return [(round(k * (width + gap), 6), round(k * (width + gap) + width, 6)) for k in range(count)]


def axis_suffix(k: int) -> str:
    """Suffix of the k-th axis in plotly: "", "2", "3", ...

    Example:
        >>> axis_suffix(0), axis_suffix(1)
        ('', '2')
    """
    return "" if k == 0 else str(k + 1)


def stacked(axes: Mapping[str, Spec], gap_px: int, height_px: int) -> Spec:
    """Panels one below the other, for a phone: the axes, with new domains; the lowest has the title of the abscissa.

    Args:
        axes: `xaxis`, `yaxis`, `xaxis2`, `yaxis2`, ...: one pair per panel.
        gap_px: between two panels, for ticks and the next title.
        height_px: of all panels together.

    Example:
        >>> panels = {"xaxis": {}, "yaxis": {}, "xaxis2": {}, "yaxis2": {}}
        >>> [of["domain"] for of in stacked(panels, 20, 200).values()]
        [(0.0, 1.0), (0.55, 1.0), (0.0, 1.0), (0.0, 0.45)]
    """
    count = len(axes) // 2
    rows = equal_domains(count, gap_px / height_px)[::-1]
    out: Spec = {}
    first: Spec = axes["yaxis"].get("title", {})
    for k in range(count):
        x, y = f"xaxis{axis_suffix(k)}", f"yaxis{axis_suffix(k)}"
        out |= {x: axes[x] | {"domain": (0.0, 1.0)}, y: axes[y] | {"domain": rows[k]}}
        if k < count - 1 and "title" in axes[x]:
            out[x]["title"] = {"text": ""}
        # next to each other, panels of one row share the title of the first
        if first and not out[y]["title"]["text"]:
            out[y]["title"] = first
    return out


def annotation(text: str, x: float, y: float, **more: Any) -> Spec:
    """A text on the figure; x and y are fractions of the plot unless `xref` or `yref` is given."""
    return {"text": text, "x": x, "y": y, "xref": "paper", "yref": "paper", "showarrow": False, **more}


def threshold_line(**where: Any) -> Spec:
    """A threshold_line line: a threshold."""
    return {"type": "line", "line": {"color": "@muted", "width": 1, "dash": "dash"}, **where}


def running_rms(x: Array, samples: int) -> Array:
    """Centred running root mean square; NaN where half of the window or more is not measured.

    Example:
        >>> running_rms(np.array([0.0, 3.0, 3.0, 3.0, np.nan, np.nan]), 3).round(2)
        array([2.12, 2.45, 3.  , 3.  ,  nan,  nan])
    """
    known = np.isfinite(x)
    window = np.ones(min(samples, len(x)))
    here = np.convolve(np.ones(len(x)), window, "same")
    count = np.convolve(known, window, "same")
    total = np.convolve(np.where(known, x, 0.0) ** 2, window, "same")
    mean: Array = np.divide(total, count, out=np.full(len(x), math.nan), where=count > here / 2)
    running: Array = np.sqrt(np.maximum(mean, 0.0))
    return running


def rms(x: Array) -> float:
    """Root mean square of the finite values; NaN for none.

    Example:
        >>> float(rms(np.array([3.0, np.nan, -3.0])))
        3.0
    """
    known = x[np.isfinite(x)]
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan
