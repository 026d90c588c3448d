"""Parameters of the driver over a drive as an SVG: estimates of windows, the smoothed level with its band, changes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from canid.drive_parameters import Identified
from canid.identification.confidence import NORMAL_QUANTILE
from canid.types import Array, Interval
from canid.views.names import SYMBOLS, readable
from canid.views.numbers import number

WIDTH, PANEL_HEIGHT, GAP = 880, 200, 46
LEFT, RIGHT, TOP = 70, 20, 40
# of the ordinate, on both sides, that the estimates of single windows may lie outside of the band before they are cut off
MARGIN = 0.6
# s between two ticks, the first that gives no more than ten of them
TICKS_S = (30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 3600.0)


def svg(drive: Identified, log: str, vehicle: str) -> str:
    """Draw every parameter that has a local level, one panel each; without any, a sentence."""
    found = drive.whole.get("fopdt")
    details: Mapping[str, Any] = found.details if found is not None else {}
    panels = details.get("constancy", ())
    changes = [change.t for change in details.get("changes", ())]
    height = TOP + max(len(panels), 1) * (PANEL_HEIGHT + GAP)
    title = escape(f"{log}: {vehicle}")
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="13">',
        "<!-- canid identify -->",
        '<rect width="100%" height="100%" fill="white"/>',
        f'<text x="{LEFT}" y="22" font-weight="bold">{title}</text>',
    ]
    if not panels:
        parts.append(
            f'<text x="{LEFT}" y="{TOP + 40}">the drive is too short to follow a parameter over it</text>'
        )
    for k, panel in enumerate(panels):
        parts += _panel(panel, changes, drive.duration, TOP + k * (PANEL_HEIGHT + GAP))
    return "\n".join([*parts, "</svg>"]) + "\n"


def _panel(panel: Mapping[str, Any], changes: Sequence[Interval], duration: float, top: float) -> list[str]:
    """One parameter over the drive."""
    t, level, low, high = (np.asarray(panel[key], float) for key in ("t", "level", "low", "high"))
    value, half = np.asarray(panel["value"], float), NORMAL_QUANTILE * np.asarray(panel["sd"], float)
    reach = MARGIN * max(float(np.max(high) - np.min(low)), float(np.median(2.0 * half)), 1e-9)
    bottom_value, top_value = float(np.min(low)) - reach, float(np.max(high)) + reach
    end = max(duration, float(t[-1]), 1.0)

    def x(at: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * min(max(at / end, 0.0), 1.0)

    def y(at: float) -> float:
        share = min(max((at - bottom_value) / (top_value - bottom_value), 0.0), 1.0)
        return top + 20 + (PANEL_HEIGHT - 20) * (1.0 - share)

    unit = "" if panel["parameter"] == "K" else " s"
    name = f"{readable(panel['input'])} {SYMBOLS[panel['parameter']]}"
    p = panel["p_value"]
    v = panel["variation"]
    heading = (
        f"{name}{', s' if unit else ''}: constant? p = {p:.3f}; sd over the drive {number(v.value)} "
        f"[{number(v.low)}, {number(v.high)}]{unit}"
    )
    out = [f'<text x="{LEFT}" y="{top + 12}">{escape(heading)}</text>']
    out.append(
        f'<rect x="{LEFT}" y="{top + 20}" width="{WIDTH - LEFT - RIGHT}" height="{PANEL_HEIGHT - 20}" '
        'fill="none" stroke="#999"/>'
    )
    out += [
        f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(tick):.1f}" y2="{y(tick):.1f}" stroke="#e4e4e4"/>'
        f'<text x="{LEFT - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>'
        for tick in _ticks(bottom_value, top_value)
    ]
    step = next((s for s in TICKS_S if end / s <= 10.0), 3600.0 * math.ceil(end / 36_000.0))
    out += [
        f'<text x="{x(k * step):.1f}" y="{top + PANEL_HEIGHT + 16}" text-anchor="middle">{k * step:.0f} s</text>'
        for k in range(int(end / step) + 1)
    ]
    edge = [*zip(t, high, strict=True), *zip(t[::-1], low[::-1], strict=True)]
    out.append(f'<polygon points="{_points(edge, x, y)}" fill="#1f77b4" fill-opacity="0.2"/>')
    out.append(
        f'<polyline points="{_points(zip(t, level, strict=True), x, y)}" fill="none" stroke="#1f77b4" '
        'stroke-width="2"/>'
    )
    for at, v, h in zip(t, value, half, strict=True):
        out.append(
            f'<line x1="{x(at):.1f}" x2="{x(at):.1f}" y1="{y(v - h):.1f}" y2="{y(v + h):.1f}" stroke="#666"/>'
            f'<circle cx="{x(at):.1f}" cy="{y(v):.1f}" r="2.5" fill="#333"/>'
        )
    out += [
        f'<line x1="{x(change.value):.1f}" x2="{x(change.value):.1f}" y1="{top + 20}" '
        f'y2="{top + PANEL_HEIGHT}" stroke="#d62728" stroke-dasharray="5 3"/>'
        f'<text x="{x(change.value) + 4:.1f}" y="{top + 34}" fill="#d62728">{change.value:.0f} s</text>'
        for change in changes
    ]
    return out


def _points(pairs: Any, x: Any, y: Any) -> str:
    return " ".join(f"{x(a):.1f},{y(b):.1f}" for a, b in pairs)


def _ticks(low: float, high: float) -> Array:
    """Round numbers between two values, about five.

    >>> _ticks(3.9, 6.2)
    array([4. , 4.5, 5. , 5.5, 6. ])
    """
    rough = (high - low) / 5.0
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(size * k for k in (1.0, 2.0, 5.0, 10.0) if size * k >= rough)
    made: Array = np.round(np.arange(math.ceil(low / step), math.floor(high / step) + 1) * step, 9)
    return made
