"""Where over operating points the simulation is wrong: the mean residual over two roles, before and after."""

from __future__ import annotations

import numpy as np

from canid.findings import OperatingMap, Report
from canid.types import Array
from canid.views.measures import number, role_unit, spoken
from canid.views.report.figure import MARGIN, Figure, Spec, axis, layout, listed, note, spans

HEIGHT = 330  # px
# cells up to which the number is written into each: more do not fit on A4
MOST_WRITTEN = 64


def maps(report: Report) -> list[Figure]:
    """Draw each map, before beside after on one colour scale."""
    return [_map(report, of, k) for k, of in enumerate(report.maps)]


def _map(report: Report, of: OperatingMap, k: int) -> Figure:
    unit = role_unit(report.output)
    sides = [("baseline" if report.findings else "simulation", of.before)]
    sides += [("extended model", of.after)] if report.findings else []
    largest = max((float(np.nanmax(np.abs(z))) for _, z in sides if np.isfinite(z).any()), default=1.0)
    domains = spans(2, 0.06)
    names = {axis: f"{spoken(role)} ({role_unit(role)})" for axis, role in (("x", of.x), ("y", of.y))}
    data: list[Spec] = []
    axes: Spec = {"coloraxis": _colours(unit, largest)}
    titles = []
    for side, (says, z) in enumerate(sides):
        end = "" if side == 0 else "2"
        data.append(_heat(of, z, unit, end))
        axes[f"xaxis{end}"] = axis(names["x"], domain=domains[side], anchor=f"y{end}", showgrid=False)
        axes[f"yaxis{end}"] = axis(
            names["y"] if side == 0 else "", anchor=f"x{end}", showgrid=False, showticklabels=side == 0
        ) | ({"matches": "y"} if side else {})
        titles.append(note(says, domains[side][0], 1.0, xanchor="left", yanchor="bottom", yshift=4))
    roles = f"{spoken(of.x)} and {spoken(of.y)}"
    return Figure(
        f"map-{k + 1}",
        f"Residual over {roles}",
        _says(of, sides, unit),
        f"Heat map of the mean residual over {roles}, {' and '.join(says for says, _ in sides)}",
        HEIGHT,
        data,
        layout(axes, annotations=titles, margin=MARGIN | {"r": 80}),
    )


def _heat(of: OperatingMap, z: Array, unit: str, end: str) -> Spec:
    hover = (
        f"{spoken(of.x)} %{{x}} {role_unit(of.x)}<br>{spoken(of.y)} %{{y}} {role_unit(of.y)}"
        f"<br>mean residual %{{z:.2f}} {unit}<br>%{{customdata:.0f}} s<extra></extra>"
    )
    written = {"texttemplate": "%{z:.1f}", "textfont": {"size": 10}} if z.size <= MOST_WRITTEN else {}
    return {
        "type": "heatmap", "x": listed(of.x_edges), "y": listed(of.y_edges), "z": listed(z.T), "hoverongaps": False,
        "customdata": listed(of.seconds.T), "coloraxis": "coloraxis", "xaxis": f"x{end}", "yaxis": f"y{end}",
        "hovertemplate": hover, "xgap": 1, "ygap": 1, **written,
    }  # fmt: skip


def _colours(unit: str, largest: float) -> Spec:
    """Two hues that stay apart for all kinds of colour vision, with the page's ground at zero."""
    return {
        "cmin": -largest, "cmax": largest, "cmid": 0.0,
        "colorscale": [[0.0, "@low"], [0.5, "@page"], [1.0, "@high"]],
        "colorbar": {
            "title": {"text": f"mean ({unit})", "side": "right", "font": {"size": 12}}, "tickfont": {"size": 11},
            "thickness": 12, "outlinewidth": 0, "x": 1.01, "ypad": 0,
        },
    }  # fmt: skip


def _says(of: OperatingMap, sides: list[tuple[str, Array]], unit: str) -> str:
    before = sides[0][1]
    if not np.isfinite(before).any():
        return "Nowhere long enough for a mean."
    i, j = np.unravel_index(int(np.nanargmax(np.abs(before))), before.shape)
    cell = (
        f"{spoken(of.x)} {of.x_edges[i]:.3g} to {of.x_edges[i + 1]:.3g} {role_unit(of.x)} and "
        f"{spoken(of.y)} {of.y_edges[j]:.3g} to {of.y_edges[j + 1]:.3g} {role_unit(of.y)}"
    )
    there = number(float(of.seconds[i, j]), "s")
    says = f"Largest mean residual: {number(float(before[i, j]), unit)} at {cell} ({there} there)"
    if len(sides) > 1:
        says += f", with the extended model {number(float(sides[1][1][i, j]), unit)}"
    spread = [
        number(float(np.sqrt(np.nansum(z**2 * of.seconds) / np.nansum(of.seconds))), unit) for _, z in sides
    ]
    says += f". Weighted by time, the map's rms is {' → '.join(spread)}."
    return says + " Blank: never there, or too briefly. A pattern, not a single cell, points to a cause."
