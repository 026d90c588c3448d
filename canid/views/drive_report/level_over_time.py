"""K and τ + θ over a whole drive: windows, the smoothed level with its band (local level), and changes of the gains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from canid.drive_parameters import Identified
from canid.identification.confidence import MISS, NORMAL_QUANTILE
from canid.views.drive_report.panels import Panel, band, instants, shown_range, stack
from canid.views.names import SYMBOLS, readable
from canid.views.numbers import gain_unit, number
from canid.views.report.figure import Figure, Spec, line, times, to_list


def level_over_time(name: str, drive: Identified, output: str, span: tuple[float, float]) -> Figure | None:
    """One panel per known parameter; None where the drive is too short for a local level."""
    found = drive.headline
    details: Mapping[str, Any] = {} if found is None else found.details
    levels = details.get("constancy", ())
    if not levels:
        return None
    panels = [_panel(one, output) for one in levels]
    changes = [(change.t.value, f"{change.t.value:.0f} s") for change in details.get("changes", ())]
    shapes, texts = instants(changes, "bad")
    return stack(
        name,
        "Is the driver constant? Parameters over the drive",
        _caption(levels, len(changes)),
        panels,
        span=span,
        shapes=shapes,
        annotations=texts,
    )


def _panel(one: Mapping[str, Any], output: str) -> Panel:
    t, level, low, high = (np.asarray(one[key], float) for key in ("t", "level", "low", "high"))
    value, half = np.asarray(one["value"], float), NORMAL_QUANTILE * np.asarray(one["sd"], float)
    unit = gain_unit(output, one["input"]) if one["parameter"] == "K" else "s"
    dots: Spec = {
        "type": "scatter", "mode": "markers", "x": times(t), "y": to_list(value), "name": "windows, 95 %",
        "legendgroup": "windows, 95 %", "marker": {"color": "@measured", "size": 5},
        "error_y": {"type": "data", "array": to_list(half), "color": "@bar", "thickness": 1, "width": 2},
    }  # fmt: skip
    title = f"{readable(one['input'])} {SYMBOLS[one['parameter']]} ({unit})"
    data = [
        band(t, low, high, "level, 95 %", "after"),
        dots,
        line(times(t), level, "level (Kalman smoother)", "after"),
    ]
    return Panel(title, data, 150, shown_range([low, high, value]))


def _caption(levels: Any, changes: int) -> str:
    said = []
    for one in levels:
        p, v = one["p_value"], one["variation"]
        unit = "" if one["parameter"] == "K" else " s"
        verdict = (
            f"varies, sd {number(v.value)} [{number(v.low)}, {number(v.high)}]{unit}"
            if p < MISS
            else "no change shown"
        )
        name = f"{readable(one['input'])} {SYMBOLS[one['parameter']]}"
        said.append(f"{name}: {verdict} (p = {p:.3f} of a constant one)")
    steps = f" Dashed: {changes} step{'s' * (changes > 1)} of the gains." if changes else ""
    window = levels[0]["window"]
    return (
        f"Dots are windows of {window:.0f} s of usable data, with 95 % intervals. {'. '.join(said)}.{steps}"
    )
