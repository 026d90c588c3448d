"""Heat maps of the mean residual over operating points: two roles, baseline and extended model."""

from __future__ import annotations

import math

import numpy as np

from canid.findings import OperatingMap, Report, extends
from canid.types import Array
from canid.views.names import readable
from canid.views.numbers import number, role_unit
from canid.views.report.figure import (
    MARGIN_PX,
    NARROW_MARGIN_PX,
    Figure,
    Spec,
    annotation,
    axis,
    equal_domains,
    layout,
    stacked,
    to_list,
)

MAP_HEIGHT_PX = 330
# px on a phone: one map, and between two
NARROW_MAP_PX, NARROW_GAP_PX = 190, 46
# of the width, of a map that is alone, which leaves room for nothing else
SINGLE_WIDTH = 0.62
# cells up to which each shows its value: more do not fit on A4
MAX_LABELLED_CELLS = 64


def heat_maps(report: Report) -> list[Figure]:
    """Each map of the report; baseline and extended model next to each other, with one scale."""
    return [_map(report, of, k) for k, of in enumerate(report.maps)]


def _map(report: Report, of: OperatingMap, k: int) -> Figure:
    unit = role_unit(report.output)
    sides = [("baseline" if extends(report) else "simulation", of.before)]
    sides += [("extended model", of.after)] if extends(report) else []
    largest = max((float(np.nanmax(np.abs(z))) for _, z in sides if np.isfinite(z).any()), default=1.0)
    domains = equal_domains(2, 0.06) if len(sides) > 1 else [(0.0, SINGLE_WIDTH)]
    names = {axis: f"{readable(role)} ({role_unit(role)})" for axis, role in (("x", of.x), ("y", of.y))}
    data: list[Spec] = []
    axes: Spec = {}
    titles, narrow_titles = [], []
    for side, (name, z) in enumerate(sides):
        end = "" if side == 0 else "2"
        data.append(_heat(of, z, unit, end))
        axes[f"xaxis{end}"] = axis(names["x"], domain=domains[side], anchor=f"y{end}", showgrid=False)
        axes[f"yaxis{end}"] = axis(
            names["y"] if side == 0 else "", anchor=f"x{end}", showgrid=False, showticklabels=side == 0
        ) | ({"matches": "y"} if side else {})
        style = {"xanchor": "left", "yanchor": "bottom", "yshift": 4}
        titles.append(annotation(name, domains[side][0], 1.0, **style))
        narrow_titles.append(annotation(name, 0.0, 1.0, yref=f"y{end} domain", **style))
    colors = _color_axis(unit, largest, domains[-1][1] + 0.01)
    panels = NARROW_MAP_PX * len(sides) + NARROW_GAP_PX * (len(sides) - 1)
    of_phone = stacked(axes, NARROW_GAP_PX, panels)
    if len(sides) > 1:
        of_phone["yaxis2"] |= {"showticklabels": True}
    roles = f"{readable(of.x)} and {readable(of.y)}"
    return Figure(
        f"map-{k + 1}",
        f"Residual over {roles}",
        _caption(of, sides, unit),
        f"Heat map of the mean residual over {roles}, {' and '.join(name for name, _ in sides)}",
        MAP_HEIGHT_PX,
        data,
        layout(axes | {"coloraxis": colors}, annotations=titles, margin=MARGIN_PX | {"r": 80}),
        (
            panels + NARROW_MARGIN_PX["t"] + NARROW_MARGIN_PX["b"],
            of_phone
            | {
                "coloraxis": _color_axis(unit, largest, 1.02),
                "annotations": narrow_titles,
                "margin": NARROW_MARGIN_PX | {"r": 66},
            },
        ),
    )


def _heat(of: OperatingMap, z: Array, unit: str, end: str) -> Spec:
    hover = (
        f"{readable(of.x)} %{{x}} {role_unit(of.x)}<br>{readable(of.y)} %{{y}} {role_unit(of.y)}"
        f"<br>mean residual %{{z:.2f}} {unit}<br>%{{customdata:.0f}} s<extra></extra>"
    )
    labels = {"texttemplate": "%{z:.1f}", "textfont": {"size": 10}} if z.size <= MAX_LABELLED_CELLS else {}
    return {
        "type": "heatmap", "x": to_list(of.x_edges), "y": to_list(of.y_edges), "z": to_list(z.T), "hoverongaps": False,
        "customdata": to_list(of.seconds.T), "coloraxis": "coloraxis", "xaxis": f"x{end}", "yaxis": f"y{end}",
        "hovertemplate": hover, "xgap": 1, "ygap": 1, **labels,
    }  # fmt: skip


def _color_axis(unit: str, largest: float, x: float) -> Spec:
    """A diverging scale that is safe for color blindness, with the page's background at zero."""
    return {
        "cmin": -largest, "cmax": largest, "cmid": 0.0,
        "colorscale": [[0.0, "@low"], [0.5, "@page"], [1.0, "@high"]],
        "colorbar": {
            "title": {"text": f"mean residual ({unit})", "side": "right", "font": {"size": 12}}, "tickfont": {"size": 11},
            "thickness": 12, "outlinewidth": 0, "x": x, "ypad": 0,
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


def _caption(of: OperatingMap, sides: list[tuple[str, Array]], unit: str) -> str:
    before = sides[0][1]
    if not np.isfinite(before).any():
        return "No cell has enough samples for a mean."
    i, j = np.unravel_index(int(np.nanargmax(np.abs(before))), before.shape)
    cell = (
        f"{readable(of.x)} {_range(of.x_edges, int(i))} {role_unit(of.x)} and "
        f"{readable(of.y)} {_range(of.y_edges, int(j))} {role_unit(of.y)}"
    )
    time = number(float(of.seconds[i, j]), "s")
    caption = f"Largest mean residual: {number(float(before[i, j]), unit)} at {cell} ({time})"
    if len(sides) > 1:
        caption += f", with the extended model {number(float(sides[1][1][i, j]), unit)}"
    rms = [
        number(float(np.sqrt(np.nansum(z**2 * of.seconds) / np.nansum(of.seconds))), unit) for _, z in sides
    ]
    caption += f". The time-weighted rms of the map is {' → '.join(rms)}."
    return caption + " Blank: no samples, or too few. A pattern points to a cause, a single cell does not."
