"""The list of results that have a text, a fragment of HTML, a plot and a table; `canid.values.presentation` asks for it."""

from __future__ import annotations

from canid.analysis.comparison.comparison import Comparison
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_reader import Drive
from canid.ui.views import data_frame, identification_document, identification_text, plots
from canid.ui.views.comparison_report import comparison_document
from canid.ui.views.diagnosis_report import diagnosis_document, diagnosis_text
from canid.ui.views.notebook import channel_rows, drive_fragment, trace_fragment
from canid.values.findings import Report
from canid.values.presentation import Presenter
from canid.values.text import estimate_text, numbers
from canid.values.types import Channel, Estimate, Interval, Trace

PRESENTERS: dict[type, Presenter] = {
    Interval: Presenter(
        lambda interval: [numbers.interval(interval)], channel_rows.interval_html, plots.interval_plot
    ),
    Channel: Presenter(
        lambda channel: [estimate_text.channel("", channel, places=None).removeprefix(": ")],
        channel_rows.channel_html,
        plots.channel_plot,
    ),
    Estimate: Presenter(
        lambda estimate: [estimate_text.estimate(estimate)], channel_rows.estimate_html, plots.estimate_plot
    ),
    Trace: Presenter(
        trace_fragment.trace_text,
        trace_fragment.trace_html,
        plots.trace_plot,
        frame=data_frame.trace_frame,
    ),
    Drive: Presenter(
        drive_fragment.drive_text,
        drive_fragment.drive_html,
        plots.drive_plot,
        frame=lambda drive, library: data_frame.trace_frame(drive.trace, library),
    ),
    Identified: Presenter(
        identification_text.summary,
        identification_document.notebook,
        plots.identified_plot,
        {"step": plots.step_plot, "frequency": plots.frequency_plot},
        data_frame.parameters_frame,
    ),
    Report: Presenter(diagnosis_text.text, diagnosis_document.notebook, plots.report_plot),
    Comparison: Presenter(comparison_document.text, comparison_document.notebook, plots.comparison_plot),
}


def find(kind: type) -> Presenter:
    """The presenter of a type of result.

    Example:
        >>> find(Interval).summary(Interval(5.6, 5.3, 5.9))
        ['5.60 [5.30, 5.90]']
    """
    return PRESENTERS[kind]
