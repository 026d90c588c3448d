"""Heat maps of the mean residual over operating points: two roles, baseline and extended model."""

from __future__ import annotations

import math

import numpy as np

from canid.ui.views.drawing.figure import Figure, Spec, to_list
from canid.ui.views.drawing.grid import Tile, grid
from canid.ui.views.drawing.panels import titled
from canid.values.findings import OperatingMap, Report, extends
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit
from canid.values.types import Array

# px of a map, and on a phone
MAP_PX = (250, 190)
# cells up to which each shows its value: more do not fit on A4
MAX_LABELLED_CELLS = 64


def heat_maps(report: Report) -> list[Figure]:
    """Each map of the report; baseline and extended model next to each other, with one scale."""
    return [_map(report, cells, k) for k, cells in enumerate(report.maps)]


def _map(report: Report, cells: OperatingMap, k: int) -> Figure:
    unit = role_unit(report.output)
    sides = [("baseline" if extends(report) else "simulation", cells.before)]
    sides += [("extended model", cells.after)] * extends(report)
    largest = max((float(np.nanmax(np.abs(z))) for _, z in sides if np.isfinite(z).any()), default=1.0)
    plain = {"showgrid": False}
    tiles = [
        Tile(name, [_heat(cells, z, unit)], plain, plain | ({"matches": "y"} if side else {}))
        for side, (name, z) in enumerate(sides)
    ]
    x, y = (titled(role, role_unit(role)) for role in (cells.x, cells.y))
    roles = f"{readable(cells.x)} and {readable(cells.y)}"
    alt = f"Heat map of the mean residual over {roles}, {' and '.join(name for name, _ in sides)}"
    figure = Figure(f"map-{k + 1}", f"Residual over {roles}", _caption(cells, sides, unit), alt)
    return grid(figure, tiles, (x, y), MAP_PX, coloraxis=_color_axis(unit, largest))


def _heat(cells: OperatingMap, z: Array, unit: str) -> Spec:
    hover = (
        f"{readable(cells.x)} %{{x}} {role_unit(cells.x)}<br>{readable(cells.y)} %{{y}} {role_unit(cells.y)}"
        f"<br>mean residual %{{z:.2f}} {unit}<br>%{{customdata:.0f}} s<extra></extra>"
    )
    labels = {"texttemplate": "%{z:.1f}", "textfont": {"size": 10}} if z.size <= MAX_LABELLED_CELLS else {}
    return {
        "type": "heatmap", "x": to_list(cells.x_edges), "y": to_list(cells.y_edges), "z": to_list(z.T), "hoverongaps": False,
        "customdata": to_list(cells.seconds.T), "coloraxis": "coloraxis",
        "hovertemplate": hover, "xgap": 1, "ygap": 1, **labels,
    }  # fmt: skip


def _color_axis(unit: str, largest: float) -> Spec:
    """A diverging scale that is safe for color blindness, with the page's background at zero."""
    return {
        "cmin": -largest, "cmax": largest, "cmid": 0.0,
        "colorscale": [[0.0, "@low"], [0.5, "@page"], [1.0, "@high"]],
        "colorbar": {
            "title": {"text": f"mean residual ({unit})", "side": "right", "font": {"size": 12}}, "tickfont": {"size": 11},
            "thickness": 12, "outlinewidth": 0, "x": 1.02, "ypad": 0,
        },
    }  # fmt: skip


def _range(edges: Array, k: int) -> str:
    """Both edges of a bin, with the decimals that its width supports.

    Example:
        >>> _range(np.array([-0.655, 0.00656]), 0)
        '-0.66 to 0.01'
    """
    width = float(edges[k + 1] - edges[k])
    places = max(1 - math.floor(math.log10(width)), 0) if width > 0 else 2
    return f"{edges[k]:.{places}f} to {edges[k + 1]:.{places}f}"


def _caption(cells: OperatingMap, sides: list[tuple[str, Array]], unit: str) -> str:
    before = sides[0][1]
    if not np.isfinite(before).any():
        return "No cell has enough samples for a mean."
    i, j = np.unravel_index(int(np.nanargmax(np.abs(before))), before.shape)
    cell = (
        f"{readable(cells.x)} {_range(cells.x_edges, int(i))} {role_unit(cells.x)} and "
        f"{readable(cells.y)} {_range(cells.y_edges, int(j))} {role_unit(cells.y)}"
    )
    time = number(float(cells.seconds[i, j]), "s")
    caption = f"Largest mean residual: {number(float(before[i, j]), unit)} at {cell} ({time})"
    if len(sides) > 1:
        caption += f", with the extended model {number(float(sides[1][1][i, j]), unit)}"
    rms = [
        number(float(np.sqrt(np.nansum(z**2 * cells.seconds) / np.nansum(cells.seconds))), unit)
        for _, z in sides
    ]
    caption += f". The time-weighted rms of the map is {' → '.join(rms)}."
    return caption + " Blank: no samples, or too few. A pattern points to a cause, a single cell does not."
