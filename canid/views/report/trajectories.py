"""What the better model is worth where it counts: gap and speed in closed loop, behind the lead of the log."""

from __future__ import annotations

from canid.findings import Report
from canid.views.measures import number, percent, role_unit, spoken
from canid.views.report.figure import MARGIN, Figure, Spec, axis, layout, line, rms, spans, suffix, times
from canid.views.report.strip import inside
from canid.views.report.thinning import MOST, kept

ROW_HEIGHT = 190  # px


def trajectories(report: Report) -> Figure | None:
    """Draw one row per quantity; None where no closed loop was simulated."""
    if not report.closed_loop:
        return None
    keep = inside(report.t, [(w.start, w.stop) for w in report.worst])
    rows = spans(len(report.closed_loop), 0.07)[::-1]
    data: list[Spec] = []
    axes: Spec = {}
    for k, of in enumerate(report.closed_loop):
        pairs = [("measured", of.measured, "measured"), (_before(report), of.before, "before")]
        pairs += [("extended model", of.after, "after")] if report.findings else []
        for name, y, colour in pairs:
            at = kept(y, keep)
            data.append(
                line(times(report.t[at]), y[at], name, colour, axes=("x", f"y{suffix(k)}"), showlegend=k == 0)
            )
        axes[f"yaxis{suffix(k)}"] = axis(f"{spoken(of.role)} ({role_unit(of.role)})", domain=rows[k], hoverformat=".2f")
    bottom = f"y{suffix(len(rows) - 1)}"
    axes["xaxis"] = axis("time in the log (s)", anchor=bottom, domain=[0, 1], hoverformat=".1f")
    return Figure(
        "closed-loop",
        "Trajectories in closed loop",
        _says(report),
        f"{' and '.join(spoken(of.role) for of in report.closed_loop)} over time, measured and simulated in closed loop",
        MARGIN["t"] + MARGIN["b"] + ROW_HEIGHT * len(rows),
        data,
        layout(axes, hovermode="x"),
    )


def _before(report: Report) -> str:
    return "baseline" if report.findings else "simulation"


def _says(report: Report) -> str:
    says = "The lead is the log's; driver and car are simulated, so that an error of one second is in all that follows."
    for of in report.closed_loop:
        unit = role_unit(of.role)
        says += f" {spoken(of.role).capitalize()}: error {number(rms(of.before - of.measured), unit)} rms"
        if report.findings:
            says += (
                f" → {number(rms(of.after - of.measured), unit)}, its variance reduced by {percent(of.gain)} "
                "on data that chose nothing"
            )
        says += "."
    if len(report.t) > MOST:
        says += " Lines are thinned to the extremes of each bucket; in the worst windows every sample is drawn."
    return says
