"""Panels in rows and columns, each with axes of its own; on a phone one below the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from canid.ui.views.drawing.figure import (
    MARGIN_PX,
    NARROW_MARGIN_PX,
    Figure,
    Spec,
    annotation,
    axis,
    axis_suffix,
    equal_domains,
    layout,
    once,
    stacked,
    threshold_line,
)

# panels next to each other: three are still readable on A4
MAX_COLUMNS = 3
# px above the panels, for legend and titles; on a phone, and between two panels there
TOP_PX, NARROW_TOP_PX, NARROW_GAP_PX = 56, 68, 42
# of the figure, between two columns and two rows
COLUMN_GAP, ROW_GAP = 0.07, 0.22


class Tile(NamedTuple):
    """One panel."""

    title: str
    data: list[Spec]  # without axes
    x: Mapping[str, Any] = {}  # of the abscissa
    y: Mapping[str, Any] = {}  # of the ordinate
    level: float = math.nan  # a dashed line


def grid(
    figure: Figure,
    tiles: Sequence[Tile],
    titles: tuple[str, str],
    heights: tuple[int, int],
    columns: int = MAX_COLUMNS,
    **more: Any,
) -> Figure:
    """Lay panels out.

    Args:
        figure: with its name, title, caption and alternative text.
        tiles: from left to right, then below.
        titles: of the abscissas, in the lowest row, and of the ordinates, in the first column.
        heights: px of a panel, and on a phone.
        columns: panels next to each other at most.
        **more: of the layout.

    Example:
        >>> of = grid(Figure("a", "", "", ""), [Tile("1", []), Tile("2", [])], ("s", "m"), (100, 80))
        >>> of.layout["xaxis2"]["domain"], of.layout["yaxis2"]["title"]["text"], of.height, of.narrow[0]
        ((0.535, 1.0), '', 200, 310)
    """
    count = len(tiles)
    across = min(MAX_COLUMNS, columns, count)
    down = math.ceil(count / across)
    places, rows = equal_domains(across, COLUMN_GAP), equal_domains(down, ROW_GAP)[::-1]
    data: list[Spec] = []
    axes: Spec = {}
    wide, narrow, shapes = [], [], []
    for k, tile in enumerate(tiles):
        x, y = f"x{axis_suffix(k)}", f"y{axis_suffix(k)}"
        column, row = places[k % across], rows[k // across]
        data += [spec | {"xaxis": x, "yaxis": y} for spec in tile.data]
        below, left = titles[0] * (k + across >= count), titles[1] * (k % across == 0)
        axes[f"xaxis{axis_suffix(k)}"] = axis(
            below, **({"domain": column, "anchor": y, "nticks": 5} | dict(tile.x))
        )
        axes[f"yaxis{axis_suffix(k)}"] = axis(
            left, **({"domain": row, "anchor": x, "nticks": 5} | dict(tile.y))
        )
        style = {"xanchor": "left", "yanchor": "bottom", "font": {"size": 11, "color": "@ink"}}
        wide.append(annotation(tile.title, column[0], row[1], **style))
        narrow.append(annotation(tile.title, 0.0, 1.0, yref=f"{y} domain", **style))
        if math.isfinite(tile.level):
            ends = {"x0": 0, "x1": 1, "y0": tile.level, "y1": tile.level}
            shapes.append(threshold_line(xref=f"{x} domain", yref=y, **ends))
    panels = heights[1] * count + NARROW_GAP_PX * (count - 1)
    whole: Spec = {"margin": MARGIN_PX | {"t": TOP_PX}, "annotations": wide, "shapes": shapes} | more
    phone = {"margin": NARROW_MARGIN_PX | {"t": NARROW_TOP_PX}, "annotations": narrow}
    return figure._replace(
        height=whole["margin"]["t"] + MARGIN_PX["b"] + heights[0] * down,
        data=once(data),
        layout=layout(axes, **whole),
        narrow=(panels + NARROW_TOP_PX + NARROW_MARGIN_PX["b"], stacked(axes, NARROW_GAP_PX, panels) | phone),
    )
