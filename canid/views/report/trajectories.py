"""What the better model is worth where it counts: gap and speed in closed loop, behind the lead of the log."""

from __future__ import annotations

from canid.findings import Report, Trajectory
from canid.types import Array
from canid.views.diagnosed import told_apart
from canid.views.measures import number, percent, role_unit, spoken
from canid.views.report.figure import MARGIN, Figure, Spec, axis, layout, line, rms, suffix, times
from canid.views.report.strip import inside
from canid.views.report.thinning import MOST, kept

ROW_HEIGHT = 270  # px, trajectory and error of one quantity
# shares of a figure's height: between two panels, and of a quantity's own
GAP = 0.03
TRAJECTORY, ERROR = 0.58, 0.42


def trajectories(report: Report) -> Figure | None:
    """Draw one row per quantity; None where no closed loop was simulated."""
    if not report.closed_loop:
        return None
    keep = inside(report.t, [(w.start, w.stop) for w in report.worst])
    panels = [panel for of in report.closed_loop for panel in _panels(report, of)]
    data: list[Spec] = []
    axes: Spec = {}
    top = 1.0
    room = 1.0 - GAP * (len(panels) - 1)
    for k, (title, share, lines) in enumerate(panels):
        height = room * share / len(report.closed_loop)
        for name, y, colour in lines:
            at = kept(y, keep)
            x, shown = times(report.t[at]), k == 0
            data.append(line(x, y[at], name, colour, axes=("x", f"y{suffix(k)}"), showlegend=shown))
        domain = [max(top - height, 0.0), top]
        axes[f"yaxis{suffix(k)}"] = axis(title, domain=domain, hoverformat=".2f", nticks=5)
        top -= height + GAP
    bottom = f"y{suffix(len(panels) - 1)}"
    axes["xaxis"] = axis("time in the log (s)", anchor=bottom, domain=[0, 1], hoverformat=".1f")
    return Figure(
        "closed-loop",
        "Trajectories in closed loop",
        _says(report),
        f"{' and '.join(spoken(of.role) for of in report.closed_loop)} over time: measured, simulated in closed loop, error",
        MARGIN["t"] + MARGIN["b"] + ROW_HEIGHT * len(report.closed_loop),
        data,
        layout(axes, hovermode="x"),
    )


def _panels(report: Report, of: Trajectory) -> list[tuple[str, float, list[tuple[str, Array, str]]]]:
    """The trajectory, and under it its error: title, share of the height, lines with name and colour."""
    sides = [(_before(report), of.before, "before")]
    sides += [("extended model", of.after, "after")] if told_apart(of) else []
    unit = role_unit(of.role)
    return [
        (f"{spoken(of.role)} ({unit})", TRAJECTORY, [("measured", of.measured, "measured"), *sides]),
        (f"error ({unit})", ERROR, [(name, y - of.measured, colour) for name, y, colour in sides]),
    ]


def _before(report: Report) -> str:
    return "baseline" if any(map(told_apart, report.closed_loop)) else "simulation"


def _says(report: Report) -> str:
    says = (
        "The lead is the log's; driver and car are simulated, so that an error of one second is in all that follows. "
        "Each stretch begins with what was measured."
    )
    for of in report.closed_loop:
        unit = role_unit(of.role)
        says += f" {spoken(of.role).capitalize()}: error {number(rms(of.before - of.measured), unit)} rms"
        if told_apart(of):
            says += (
                f" → {number(rms(of.after - of.measured), unit)}, its variance reduced by {percent(of.gain)} "
                "on data that chose nothing"
            )
        says += "."
    if len(report.t) > MOST:
        says += (
            " Lines are thinned to the extremes of each bucket; in the worst windows every sample is drawn."
        )
    return says
