"""Colored strips over time, each stretch with its state as text: statuses of estimators, gates, the monitor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from canid.ui.views.drawing.figure import MARGIN_PX, NARROW_MARGIN_PX, Figure, Spec, axis, layout
from canid.ui.views.drawing.panels import PAPER_PX, legend_px

ROW_HEIGHT_PX = 38
# px for the names of the rows
NAMES_PX = 92
# Share of the time axis from which on a stretch holds its text: shorter ones have it on hover and in the legend
LABELLED_SHARE = 0.06
# Color of the style sheet and hatching, by state: color alone says nothing to many readers.
STYLES: Mapping[str, tuple[str, str]] = {
    "ok": ("good", ""),
    "fits": ("good", ""),
    "used": ("good", ""),
    "converging": ("bar", "/"),
    "learning": ("bar", "/"),
    "not excited": ("rival", "\\"),
    "no lead": ("grid", ""),
    "no driver": ("bar", "x"),
    "stale": ("before", "x"),
    "inconsistent": ("bad", "+"),
    "misfit": ("bad", "+"),
    "finding": ("bad", "/"),
    "ARMAX": ("before", ""),
    "FOPDT": ("after", ""),
    "none": ("grid", ""),
}
# of other states, in the order in which they come: each figure has its own, and no two of its legend are alike
OTHER_STYLES = tuple(
    (color, hatch) for hatch in ("", "/", "x", ".", "-", "|") for color in ("bar", "before", "rival", "grid")
)


class Stretch(NamedTuple):
    """A row's state from start to stop."""

    row: str
    state: str
    start: float  # s
    stop: float  # s


def joined(row: str, at: Sequence[tuple[float, str]], end: float) -> list[Stretch]:
    """States at their times as stretches, each until the next.

    Args:
        row: name of the strip.
        at: (s, state), in the order of time.
        end: s, of the last one.

    Example:
        >>> joined("FOPDT", [(0.0, "converging"), (1.0, "ok"), (2.0, "ok")], 3.0)[1]
        Stretch(row='FOPDT', state='ok', start=1.0, stop=3.0)
    """
    out: list[Stretch] = []
    for t, state in at:
        if out and out[-1].state == state:
            continue
        if out:
            out[-1] = out[-1]._replace(stop=t)
        out.append(Stretch(row, state, t, t))
    if out:
        out[-1] = out[-1]._replace(stop=max(end, out[-1].start))
    return out


def _styles(states: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Color and hatching of each state; those beyond the list share the last.

    Example:
        >>> _styles(["used", "brake", "settling"])
        {'used': ('good', ''), 'brake': ('bar', ''), 'settling': ('before', '')}
    """
    names = list(states)
    taken = {STYLES[name] for name in names if name in STYLES}
    others = iter([style for style in OTHER_STYLES if style not in taken])
    return {name: STYLES[name] if name in STYLES else next(others, OTHER_STYLES[-1]) for name in names}


def strips(
    name: str, title: str, caption: str, several: Sequence[Stretch], span: tuple[float, float]
) -> Figure | None:
    """One row per name, from above to below in the order of their first stretch; None: there is none."""
    rows = list(dict.fromkeys(stretch.row for stretch in several))
    if not rows:
        return None
    long = max(span[1] - span[0], 1e-9)
    data: list[Spec] = []
    styles = _styles(dict.fromkeys(stretch.state for stretch in several))
    for state, (color, hatch) in styles.items():
        mine = [stretch for stretch in several if stretch.state == state and stretch.stop > stretch.start]
        data.append(
            {
                "type": "bar", "orientation": "h", "name": state, "legendgroup": state,
                "y": [stretch.row for stretch in mine], "base": [round(stretch.start, 2) for stretch in mine],
                "x": [round(stretch.stop - stretch.start, 2) for stretch in mine],
                "text": [state if stretch.stop - stretch.start > LABELLED_SHARE * long else "" for stretch in mine],
                "textposition": "inside", "insidetextanchor": "middle", "textangle": 0, "constraintext": "none",
                "insidetextfont": {"color": "@ink", "size": 11},
                "marker": {
                    "color": f"@{color}", "opacity": 0.55, "line": {"width": 0},
                    "pattern": {"shape": hatch, "size": 6, "solidity": 0.2, "fillmode": "overlay", "fgcolor": "@page"},
                },
                "hovertemplate": f"%{{y}}: {state}, %{{base:.1f}}–%{{x:.1f}} s<extra></extra>",
            }
        )  # fmt: skip
    axes = {
        "xaxis": axis("time in the log (s)", range=list(span), hoverformat=".1f"),
        "yaxis": axis("", categoryorder="array", categoryarray=rows[::-1], showgrid=False, fixedrange=True),
    }
    names = list(dict.fromkeys(stretch.state for stretch in several))
    top = max(MARGIN_PX["t"], legend_px(names, PAPER_PX))
    height = top + MARGIN_PX["b"] + ROW_HEIGHT_PX * len(rows)
    above = max(legend_px(names), 12)
    alt = f"Strips over time: {', '.join(rows)}; states: {', '.join(names)}"
    return Figure(
        name,
        title,
        caption,
        alt,
        height,
        data,
        layout(axes, barmode="overlay", bargap=0.25, margin=MARGIN_PX | {"l": NAMES_PX, "t": top}),
        (height - top + above, {"margin": NARROW_MARGIN_PX | {"l": NAMES_PX - 24, "t": above}}),
    )
