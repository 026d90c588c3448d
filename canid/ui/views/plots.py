"""`result.plot()`: the figures of the reports as plotly figures, for notebooks and scripts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

import numpy as np

from canid.analysis.comparison.comparison import Comparison
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_reader import Drive
from canid.ui.views.comparison_report import comparison_document
from canid.ui.views.diagnosis_report.time_series import whole_drive
from canid.ui.views.drawing.figure import MARGIN_PX, Figure, Spec, axis, layout, to_list
from canid.ui.views.drawing.panels import Panel, shade_spans, signal, titled
from canid.ui.views.drawing.plotly_package import plotly_figure
from canid.ui.views.drive_report import responses
from canid.ui.views.drive_report.estimates_over_time import gains_over_time
from canid.ui.views.drive_report.model_over_time import model_over_time, unused
from canid.ui.views.notebook.channel_rows import rows
from canid.values.findings import Report
from canid.values.text.names import label, method, readable
from canid.values.text.numbers import interval
from canid.values.types import Channel, Estimate, Interval, Status, Trace

# points of a line
MAX_POINTS = 6000


def interval_plot(interval: Interval) -> Any:
    """One interval."""
    return _forest([("", interval, "")], "", "95 % interval")


def channel_plot(channel: Channel) -> Any:
    """What may be quoted of a channel."""
    return _channels({"": channel}, "")


def estimate_plot(estimate: Estimate) -> Any:
    """The parameters of an estimate."""
    title = f"{method(estimate.estimator)} at {estimate.t:.1f} s: {estimate.status.value}"
    return _channels(estimate.channels if estimate.status is Status.OK else {}, title)


def trace_plot(trace: Trace) -> Any:
    """Output and inputs; grey: not used for identification."""
    return plotly_figure(model_over_time("trace", trace, None, "output", np.nan, MAX_POINTS), "Trace")


def drive_plot(drive: Drive) -> Any:
    """K of every input as the estimators saw it along the drive, above the output."""
    trace, estimates = drive.trace, drive.estimates
    if not len(trace.t):
        return plotly_figure(None, "no samples")
    line = signal(trace.t, trace.output, "output", "measured", MAX_POINTS, showlegend=False)
    span = (float(trace.t[0]), float(trace.t[-1]))
    figure = gains_over_time(
        estimates, trace.input_names, "", span, more=[Panel("output", [line])], shapes=unused(trace)
    )
    return plotly_figure(figure, "Estimates over the drive")


def identified_plot(result: Identified) -> Any:
    """K of every input over the windows, with the band of the whole drive."""
    span = (0.0, max(result.duration, 1.0))
    figure = gains_over_time(
        result.windows, list(result.channels), result.drive_summary.output, span, whole=result.channels
    )
    return plotly_figure(
        figure, (result.log or "Identified driver") if result.channels else "nothing is identifiable"
    )


def step_plot(result: Identified) -> Any:
    """Step response of every method to each input."""
    figure = responses.step_response("step", result.responses, result.drive_summary.output)
    return plotly_figure(figure, "Step response" if figure else "no gain of the whole drive is known")


def frequency_plot(result: Identified) -> Any:
    """Frequency response of every method to each input, and the measured one."""
    figure = responses.frequency_response("frequency", result.responses, result.drive_summary.output)
    return plotly_figure(figure, "Frequency response" if figure else "no gain of the whole drive is known")


def report_plot(report: Report) -> Any:
    """Measured and simulated output, what is left and its running rms, with the episodes of the findings."""
    figure = whole_drive(report) if len(report.t) else None
    if figure is not None:
        episodes = [episode for finding in report.findings for episode in finding.episodes]
        shapes = [*figure.layout["shapes"], *shade_spans(episodes, "episodes of the findings", "rival")]
        figure = figure._replace(layout=dict(figure.layout) | {"shapes": shapes})
    return plotly_figure(figure, f"Diagnosis: {readable(report.verdict.value)}")


def comparison_plot(comparison: Comparison) -> Any:
    """Ratio of B over A where there is one."""
    several = [(label(row.name), row.ratio, "") for row in comparison.rows if row.compared]
    title = f"Comparison: {comparison_document.TITLES[comparison.verdict]}"
    return _forest(several, title, "B over A, 95 % interval", reference=1.0)


def _channels(channels: Mapping[str, Channel], title: str) -> Any:
    several = [(f"{name} {symbol}".strip(), iv, unit) for name, symbol, iv, unit in rows(channels, "")]
    return _forest(several, title, "95 % interval")


def _forest(
    several: Iterable[tuple[str, Interval, str]], title: str, abscissa: str, reference: float | None = None
) -> Any:
    """Known intervals below each other: name, interval and unit."""
    known = [row for row in several if np.isfinite(row[1].value)]
    values = np.array([iv for _, iv, _ in known], float).reshape(-1, 3)
    error: Spec = {
        "array": to_list(values[:, 2] - values[:, 0]), "arrayminus": to_list(values[:, 0] - values[:, 1]),
    }  # fmt: skip
    dots: Spec = {
        "type": "scatter", "mode": "markers", "x": to_list(values[:, 0]), "error_x": error,
        "y": [titled(name, unit) for name, _, unit in known], "marker": {"color": "@after", "size": 9},
        "text": [escape(interval(iv, unit)) for _, iv, unit in known],
    }  # fmt: skip
    axes = {
        "xaxis": axis(abscissa),
        "yaxis": axis("", autorange="reversed", type="category", automargin=True),
    }
    line: Spec = {"type": "line", "x0": reference, "x1": reference, "y0": 0, "y1": 1, "yref": "paper"}
    shapes = [] if reference is None else [line | {"line": {"color": "@muted", "dash": "dot"}}]
    height = MARGIN_PX["t"] + MARGIN_PX["b"] + 40 * max(len(known), 1)
    return plotly_figure(Figure("forest", title, "", "", height, [dots], layout(axes, shapes=shapes)), title)
