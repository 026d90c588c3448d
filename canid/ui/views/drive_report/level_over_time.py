"""K and τ + θ over a whole drive: windows, the smoothed level with its band (local level), and changes of the gains."""

from __future__ import annotations

from collections.abc import Sequence

from canid.analysis.drive.drive_parameters import Identified
from canid.ui.views.drawing.figure import Figure, Spec, line, times, to_list
from canid.ui.views.drawing.panels import Panel, band, instants, shown_range, stack
from canid.ui.views.drive_report.followed_parameters import FollowedParameter, change_times, followed


def level_over_time(name: str, drive: Identified, output: str, span: tuple[float, float]) -> Figure | None:
    """One panel per known parameter; None where the drive is too short for a local level."""
    parameters = followed(drive.headline, output)
    if not parameters:
        return None
    changes = change_times(drive.headline)
    shapes, texts = instants([(t, f"{t:.0f} s") for t in changes], "bad")
    return stack(
        name,
        "Is the driver constant? Parameters over the drive",
        _caption(parameters, len(changes)),
        [_panel(parameter) for parameter in parameters],
        span=span,
        shapes=shapes,
        annotations=texts,
    )


def _panel(drawn: FollowedParameter) -> Panel:
    dots: Spec = {
        "type": "scatter", "mode": "markers", "x": times(drawn.t), "y": to_list(drawn.windows),
        "name": "windows, 95 %", "legendgroup": "windows, 95 %", "marker": {"color": "@measured", "size": 5},
        "error_y": {
            "type": "data", "array": to_list(drawn.half), "color": "@bar", "thickness": 1, "width": 2
        },
    }  # fmt: skip
    data = [
        band(drawn.t, drawn.low, drawn.high, "level, 95 %", "after"),
        dots,
        line(times(drawn.t), drawn.level, "level (Kalman smoother)", "after"),
    ]
    shown = shown_range([drawn.low, drawn.high, drawn.windows])
    return Panel(f"{drawn.name} ({drawn.unit})", data, 150, shown)


def _caption(parameters: Sequence[FollowedParameter], changes: int) -> str:
    said = ". ".join(parameter.said for parameter in parameters)
    steps = f" Dashed: {changes} step{'s' * (changes > 1)} of the gains." if changes else ""
    return f"Dots are windows of {parameters[0].window:.0f} s of usable data, with 95 % intervals. {said}.{steps}"
