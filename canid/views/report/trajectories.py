"""Trajectories of gap and speed in closed-loop simulation, with the lead vehicle of the log."""

from __future__ import annotations

from canid.findings import Report, Trajectory
from canid.types import Array
from canid.views.closed_loop import change, has_extended, worse
from canid.views.names import readable
from canid.views.numbers import number, role_unit
from canid.views.report.decimation import MAX_POINTS, min_max_indices
from canid.views.report.figure import (
    MARGIN_PX,
    NARROW_MARGIN_PX,
    Figure,
    Spec,
    axis,
    axis_suffix,
    layout,
    line,
    rms,
    times,
)
from canid.views.report.time_series import inside

# px: trajectory and error of one quantity; on a phone
ROW_HEIGHT_PX, NARROW_ROW_PX, NARROW_TOP_PX = 270, 210, 58
# fractions of the figure's height: between two panels, and of one quantity's row
PANEL_GAP = 0.03
TRAJECTORY_SHARE, ERROR_SHARE = 0.58, 0.42


def trajectories(report: Report) -> Figure | None:
    """One row per quantity; None where no closed loop was simulated."""
    if not report.closed_loop:
        return None
    keep = inside(report.t, [(w.start, w.stop) for w in report.worst])
    panels = [panel for of in report.closed_loop for panel in _panels(report, of)]
    data: list[Spec] = []
    axes: Spec = {}
    top = 1.0
    available = 1.0 - PANEL_GAP * (len(panels) - 1)
    for k, (title, share, lines) in enumerate(panels):
        height = available * share / len(report.closed_loop)
        for name, y, color in lines:
            at = min_max_indices(y, keep)
            x, shown = times(report.t[at]), k == 0
            data.append(line(x, y[at], name, color, axes=("x", f"y{axis_suffix(k)}"), showlegend=shown))
        domain = [max(top - height, 0.0), top]
        axes[f"yaxis{axis_suffix(k)}"] = axis(title, domain=domain, hoverformat=".2f", nticks=5)
        top -= height + PANEL_GAP
    quantities = " and ".join(readable(of.role) for of in report.closed_loop)
    bottom = f"y{axis_suffix(len(panels) - 1)}"
    axes["xaxis"] = axis("time in the log (s)", anchor=bottom, domain=[0, 1], hoverformat=".1f")
    return Figure(
        "closed-loop",
        "Trajectories in closed loop",
        _caption(report),
        f"{quantities} over time: measured, simulated in closed loop, error",
        MARGIN_PX["t"] + MARGIN_PX["b"] + ROW_HEIGHT_PX * len(report.closed_loop),
        data,
        layout(axes, hovermode="x"),
        (
            NARROW_TOP_PX + NARROW_MARGIN_PX["b"] + NARROW_ROW_PX * len(report.closed_loop),
            {"margin": NARROW_MARGIN_PX | {"t": NARROW_TOP_PX}},
        ),
    )


def _panels(report: Report, of: Trajectory) -> list[tuple[str, float, list[tuple[str, Array, str]]]]:
    """The trajectory and below it its error: title, fraction of the height, lines with name and color."""
    sides = [(_before(report), of.before, "before")]
    sides += [("extended model", of.after, "after")] if has_extended(of) else []
    unit = role_unit(of.role)
    return [
        (f"{readable(of.role)} ({unit})", TRAJECTORY_SHARE, [("measured", of.measured, "measured"), *sides]),
        (f"error ({unit})", ERROR_SHARE, [(name, y - of.measured, color) for name, y, color in sides]),
    ]


def _before(report: Report) -> str:
    return "baseline" if any(map(has_extended, report.closed_loop)) else "simulation"


def _caption(report: Report) -> str:
    caption = (
        "The lead vehicle is the one in the log; driver and car are simulated, so that errors accumulate. Each stretch "
        "starts from the measured state, and no model was fitted to the stretch that it drives."
    )
    for of in report.closed_loop:
        unit = role_unit(of.role)
        caption += (
            f" {readable(of.role).capitalize()}: error {number(rms(of.before - of.measured), unit)} rms"
        )
        if has_extended(of):
            caption += f" → {number(rms(of.after - of.measured), unit)} rms, error variance {change(of)}"
            caption += " on held-out data"
            caption += ": worse with the extended model" * worse(of)
        caption += "."
    if len(report.t) > MAX_POINTS:
        caption += (
            " Lines are thinned to the extremes of each bucket; in the worst windows every sample is drawn."
        )
    return caption
