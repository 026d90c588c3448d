"""Parameters of the driver over a drive as an SVG file: estimates of windows, the smoothed level with its band, changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from canid.analysis.drive.drive_parameters import Identified
from canid.ui.views.document.templates import file_text
from canid.ui.views.drawing import level_panel
from canid.ui.views.drawing.palette import light
from canid.ui.views.drawing.svg import Scale, element, text, whole
from canid.ui.views.drive_report.followed_parameters import FollowedParameter, change_times, followed
from canid.values.text.numbers import number

WIDTH, PANEL_HEIGHT, GAP = 880.0, 200.0, 46.0
LEFT, RIGHT, TOP = 70.0, 20.0, 40.0
# of the ordinate, on both sides, that the estimates of single windows may lie outside of the band before they are cut off
MARGIN = 0.6


def svg(drive: Identified, log: str, vehicle: str) -> str:
    """Draw every parameter that has a local level, one panel each; without any, a sentence."""
    result = drive.whole.get("fopdt")
    parameters = followed(result, drive.drive_summary.output)
    title = f"{log}: {vehicle}"
    parts = [
        Markup("<!-- canid identify -->"),
        element("style", content=light(file_text("drawing/drawing.css"))),
        element("rect", width="100%", height="100%", fill="white"),
        text(title, LEFT, 22, "head"),
    ]
    if not parameters:
        parts.append(text("the drive is too short to follow a parameter over it", LEFT, TOP + 40))
    for k, parameter in enumerate(parameters):
        parts += _panel(parameter, change_times(result), drive.duration, TOP + k * (PANEL_HEIGHT + GAP))
    height = TOP + max(len(parameters), 1) * (PANEL_HEIGHT + GAP)
    alt = f"{title}: {'; '.join(parameter.name for parameter in parameters) or 'no parameter'} over the drive"
    drawing = whole(parts, (WIDTH, height), alt, "drawing", xmlns="http://www.w3.org/2000/svg")
    return f"{drawing}\n"


def _panel(drawn: FollowedParameter, changes: Sequence[float], duration: float, top: float) -> list[Markup]:
    """One parameter over the drive."""
    low, high = float(np.min(drawn.low)), float(np.max(drawn.high))
    reach = MARGIN * max(high - low, float(np.median(2.0 * drawn.half)), 1e-9)
    x = Scale(0.0, max(duration, float(drawn.t[-1]), 1.0), LEFT, WIDTH - RIGHT)
    y = Scale(low - reach, high + reach, top + PANEL_HEIGHT, top + 20)
    unit = " s" if drawn.unit == "s" else ""
    v = drawn.variation
    heading = (
        f"{drawn.name}{', s' if unit else ''}: constant? p = {drawn.p_value:.3f}; sd over the drive "
        f"{number(v.value)} [{number(v.low)}, {number(v.high)}]{unit}"
    )
    return [
        text(heading, LEFT, top + 12),
        *level_panel.axes(x, y),
        *level_panel.level(drawn.t, drawn.level, drawn.low, drawn.high, x, y, "b"),
        *level_panel.windows(drawn.t, drawn.windows, drawn.half, x, y),
        *level_panel.changes(changes, x, y),
    ]
