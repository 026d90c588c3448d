"""Trajectories of gap and speed in closed-loop simulation, with the lead vehicle of the log."""

from __future__ import annotations

from canid.ui.views.closed_loop import change, has_extended, worse
from canid.ui.views.diagnosis_report.time_series import inside
from canid.ui.views.drawing.decimation import MAX_POINTS
from canid.ui.views.drawing.figure import Figure, Spec, rms
from canid.ui.views.drawing.panels import Panel, signal, stack, titled
from canid.values.findings import Report, Trajectory
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit
from canid.values.types import Array

# px: a trajectory, and its error
TRAJECTORY_PX, ERROR_PX = 140, 95


def trajectories(report: Report) -> Figure | None:
    """Each quantity and its error below it; None where no closed loop was simulated."""
    if not report.closed_loop:
        return None
    panels = [panel for trajectory in report.closed_loop for panel in _panels(report, trajectory)]
    return stack("closed-loop", "Trajectories in closed loop", _caption(report), panels)


def _panels(report: Report, trajectory: Trajectory) -> list[Panel]:
    keep = inside(report.t, [(w.start, w.stop) for w in report.worst])

    def drawn(name: str, y: Array, color: str) -> Spec:
        return signal(report.t, y, name, color, MAX_POINTS, keep)

    sides = [(_before(report), trajectory.before, "before")]
    sides += [("extended model", trajectory.after, "after")] if has_extended(trajectory) else []
    unit = role_unit(trajectory.role)
    lines = [drawn(*side) for side in [("measured", trajectory.measured, "measured"), *sides]]
    errors = [drawn(name, y - trajectory.measured, color) for name, y, color in sides]
    return [
        Panel(titled(trajectory.role, unit), lines, TRAJECTORY_PX),
        Panel(f"error of the {titled(trajectory.role, unit)}", errors, ERROR_PX),
    ]


def _before(report: Report) -> str:
    return "baseline" if any(map(has_extended, report.closed_loop)) else "simulation"


def _caption(report: Report) -> str:
    caption = (
        "The lead vehicle is the one in the log; driver and car are simulated, so that errors accumulate. Each stretch "
        "starts from the measured state, and no model was fitted to the stretch that it drives."
    )
    for quantity in report.closed_loop:
        unit = role_unit(quantity.role)
        before = number(rms(quantity.before - quantity.measured), unit)
        caption += f" {readable(quantity.role).capitalize()}: error {before} rms"
        if has_extended(quantity):
            caption += f" → {number(rms(quantity.after - quantity.measured), unit)} rms, error variance {change(quantity)}"
            caption += " on held-out data"
            caption += ": worse with the extended model" * worse(quantity)
        caption += "."
    if len(report.t) > MAX_POINTS:
        caption += (
            " Lines are thinned to the extremes of each bucket; in the worst windows every sample is drawn."
        )
    return caption
