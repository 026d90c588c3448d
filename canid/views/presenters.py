"""The list of results that have a text, a fragment of HTML, a plot and a table; `canid.presentation` asks for it."""

from __future__ import annotations

from canid.comparison.comparison import Comparison
from canid.drive_parameters import Identified
from canid.findings import Report
from canid.presentation import Presenter
from canid.types import Channel, Estimate, Interval, Trace
from canid.views import comparison_text, data_frame, estimate_text, numbers, plots
from canid.views.notebook import estimate_fragment, result_fragments, trace_fragment

PRESENTERS: dict[type, Presenter] = {
    Interval: Presenter(
        lambda of: [numbers.interval(of)], estimate_fragment.interval_html, plots.interval_plot
    ),
    Channel: Presenter(
        lambda of: [estimate_text.channel("", of, places=None).removeprefix(": ")],
        estimate_fragment.channel_html,
        plots.channel_plot,
    ),
    Estimate: Presenter(
        estimate_fragment.estimate_lines, estimate_fragment.estimate_html, plots.estimate_plot
    ),
    Trace: Presenter(
        trace_fragment.trace_lines, trace_fragment.trace_html, plots.trace_plot, data_frame.trace_frame
    ),
    Identified: Presenter(
        result_fragments.identified_lines,
        result_fragments.identified_html,
        plots.identified_plot,
        data_frame.parameters_frame,
    ),
    Report: Presenter(result_fragments.report_lines, result_fragments.report_html, plots.report_plot),
    Comparison: Presenter(comparison_text.text, result_fragments.comparison_html, plots.comparison_plot),
}


def find(kind: type) -> Presenter:
    """The presenter of a type of result.

    Example:
        >>> find(Interval).summary(Interval(5.6, 5.3, 5.9))
        ['5.60 [5.30, 5.90]']
    """
    return PRESENTERS[kind]
