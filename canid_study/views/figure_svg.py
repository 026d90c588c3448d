"""Figures of a study as SVG, drawn by matplotlib."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from canid_study.artifact import Curve, Figure, Panel

# read by canid.ui.cli.output.output_kinds: a file with it may be replaced by another one
MARK = "canid study"
# inches; a page is as wide as 1080 px
WIDTH, PANEL_HEIGHT = 8.6, 2.9
# placeholders in the SVG, and the style sheet's names of the colors (canid/ui/views/document/page.css)
INK, GRID, BACKGROUND = "#1b1f24", "#e9ecee", "#fdfdfe"
COLORS = {
    "published": "#c2510c",
    "reproduced": "#0b62ad",
    "corrected": "#1a6b33",
    "measured": "#2b2f36",
    "limit": "#b3261e",
    "other": "#a3acb6",
}
VARIABLES = {
    INK: "--ink",
    GRID: "--grid",
    "#c2510c": "--before",
    "#0b62ad": "--after",
    "#1a6b33": "--good",
    "#2b2f36": "--measured",
    "#b3261e": "--bad",
    "#a3acb6": "--bar",
}
# of lines, the first one solid; dashes are those of `Curve.dashed`
PATTERNS = ("-", "-.", ":")
# lines that a legend lists one by one: more would need more height than a panel has
MAX_LISTED = 8
# points of a curve; a panel has some 800 px
MAX_POINTS = 2000
# curves with points and not more than this many get a marker each
MANY_POINTS = 60


def svg(drawing: str) -> str:
    """A drawing as a file: an SVG document with a white background.

    Example:
        >>> line = Curve(np.arange(3.0), np.arange(3.0), "a")
        >>> text = svg(drawn(Figure("fig_1", "Title", (Panel("t (s)", "y", (line,)),))))
        >>> text.startswith("<svg"), "canid study" in text, BACKGROUND in text
        (True, True, False)
    """
    return drawing.replace(BACKGROUND, "white")


def inline(drawing: str, name: str) -> str:
    """A drawing for a page: without background, colors by the page's style sheet, text by the page's font.

    Args:
        drawing: from `drawn`.
        name: of the figure; a page holds many drawings, whose ids are made unique by it.

    Example:
        >>> line = Curve(np.arange(3.0), np.arange(3.0), "a")
        >>> drawing = drawn(Figure("fig_1", "Title", (Panel("t (s)", "y", (line,)),)))
        >>> "var(--ink)" in inline(drawing, "fig_1")
        True
    """
    text = drawing.replace(BACKGROUND, "none")
    for color, variable in VARIABLES.items():
        text = text.replace(color, f"var({variable})")
    size, named = r'(<svg [^>]*?)width="[^"]*pt" height="[^"]*pt"', rf'\1role="img" aria-label="{name}"'
    text = re.sub(size, named, text, count=1)
    return re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{name}-", text)


def drawn(figure: Figure) -> str:
    """Draw a figure by matplotlib, with placeholders for the colors; the same figure gives the same text."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    settings: Any = {
        "svg.fonttype": "none",
        "svg.hashsalt": figure.name,
        "font.family": "sans-serif",
        "font.size": 9,
        "text.color": INK,
        "axes.edgecolor": INK,
        "axes.labelcolor": INK,
        "xtick.color": INK,
        "ytick.color": INK,
        "grid.color": GRID,
        "axes.axisbelow": True,
        "axes.unicode_minus": True,
    }
    with matplotlib.rc_context(settings):
        heights = [1.6 if panel.equal else 1.0 for panel in figure.panels] or [1.0]
        canvas = Canvas(figsize=(WIDTH, PANEL_HEIGHT * sum(heights)), layout="constrained")
        FigureCanvasSVG(canvas)
        canvas.patch.set_facecolor(BACKGROUND)
        if figure.panels:
            axes = canvas.subplots(len(figure.panels), 1, squeeze=False, height_ratios=heights)[:, 0]
            for axis, panel in zip(axes, figure.panels, strict=True):
                axis.patch.set_facecolor("none")
                _panel(axis, panel)
        buffer = io.StringIO()
        canvas.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :].replace(">", f">\n<!-- {MARK}: {figure.name} -->", 1)


def _panel(axes: Any, panel: Panel) -> None:
    """One pair of axes."""
    named: dict[str, int] = {}
    for curve in _listed(panel.curves):
        # lines of one color that the legend lists differ in their pattern
        k = named.get(curve.role, 0)
        named[curve.role] = k + bool(curve.label and not curve.points and not curve.dashed)
        _curve(axes, curve, PATTERNS[k % len(PATTERNS)])
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    if panel.title:
        axes.set_title(panel.title, fontsize=9, loc="left", color=INK)
    # a logarithmic axis without a positive value has no scale
    if panel.log_x and any((c.x > 0).any() for c in panel.curves):
        axes.set_xscale("log")
    if panel.log_y and any((c.y > 0).any() for c in panel.curves):
        axes.set_yscale("log")
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim")
    if panel.x_range is not None:
        axes.set_xlim(*panel.x_range)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    axes.grid(True, linewidth=0.6)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if any(curve.label for curve in panel.curves):
        axes.legend(frameon=False, fontsize=8, loc="best")


def _listed(curves: Sequence[Curve]) -> list[Curve]:
    """The curves; of many of one color the first one's label counts them, and the others have none.

    >>> many = [Curve(np.arange(3.0), np.arange(3.0), f"driver {k}") for k in range(1, 27)]
    >>> [curve.label for curve in _listed(many)][:3]
    ['driver 1 to driver 26 (26)', '', '']
    """
    out = list(curves)
    for role in {curve.role for curve in curves}:
        places = [k for k, curve in enumerate(curves) if curve.label and curve.role == role]
        if len(places) <= MAX_LISTED:
            continue
        first, last = curves[places[0]].label, curves[places[-1]].label
        for k in places:
            out[k] = curves[k]._replace(label="")
        out[places[0]] = curves[places[0]]._replace(label=f"{first} to {last} ({len(places)})")
    return out


def _curve(axes: Any, curve: Curve, pattern: str) -> None:
    """A line with its band, or points with error bars."""
    color = COLORS.get(curve.role, COLORS["other"])
    x, y = np.asarray(curve.x, float), np.asarray(curve.y, float)
    stride = max(1, -(-x.size // MAX_POINTS))
    part = slice(None, None, stride)
    label = curve.label or None
    band = curve.low is not None and curve.high is not None
    if curve.points:
        size = 4.0 if x.size <= MANY_POINTS else 2.0
        if band:
            low, high = np.asarray(curve.low, float), np.asarray(curve.high, float)
            error = np.maximum(np.stack([y - low, high - y]), 0.0)[:, part]
            axes.errorbar(
                x[part],
                y[part],
                yerror(error),
                fmt="o",
                color=color,
                markersize=size,
                linewidth=0.8,
                label=label,
            )
        else:
            axes.plot(x[part], y[part], "o", color=color, markersize=size, label=label)
        return
    if band:
        axes.fill_between(
            x[part], np.asarray(curve.low, float)[part], np.asarray(curve.high, float)[part],
            color=color, alpha=0.18, linewidth=0,
        )  # fmt: skip
    axes.plot(x[part], y[part], "--" if curve.dashed else pattern, color=color, linewidth=1.2, label=label)


def yerror(error: Any) -> Any:
    """Error bars without NaN, which matplotlib refuses."""
    return np.nan_to_num(error, nan=0.0)
