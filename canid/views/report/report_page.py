"""A diagnosis as one self-contained HTML page: tables, figures, style and script."""

from __future__ import annotations

from functools import partial
from importlib.util import find_spec

from markupsafe import Markup

from canid.findings import Report, Verdict, extends
from canid.identified_model import equation
from canid.views import search_bounds, signal_text
from canid.views.closed_loop import change, errors, has_extended, worse
from canid.views.diagnosis_parts import (
    advice,
    block_says,
    closed_loop_models,
    duration,
    estimate,
    finding_parameters,
    form,
    gains,
    known_parameters,
    model_bounds,
    model_units,
    not_quoted,
    recommendation,
    remarks,
    sentence,
    step,
    used_time,
)
from canid.views.names import parameter
from canid.views.numbers import gain_unit, role_unit, time_range
from canid.views.report.evidence_plot import SYMBOLS, evidence_plot, outcome
from canid.views.report.figure import script
from canid.views.report.forest_plot import forest_plot, shift
from canid.views.report.heat_maps import heat_maps
from canid.views.report.spectra import spectra
from canid.views.report.templates import environment, file_text
from canid.views.report.time_series import whole_drive, worst_windows
from canid.views.report.trajectories import trajectories

TITLES = {
    Verdict.ADEQUATE: "The simulation is adequate",
    Verdict.NAMED: "Cause found",
    Verdict.ONE_OF: "One of these causes",
    Verdict.UNEXPLAINED: "Unexplained",
    Verdict.NOT_ENOUGH_DATA: "Not enough data",
}


def page(report: Report) -> str:
    """The diagnosis as one HTML page.

    The page loads nothing: style, script and data are in it. The plotly.js of the installed plotly package draws the
    plots; without that package the page has its text and tables, and says how to get the plots.

    Args:
        report: the diagnosis.

    Returns:
        The page, to be stored as UTF-8.

    Example:
        >>> from canid.findings import no_fit
        >>> from canid.types import Interval
        >>> import numpy as np
        >>> nothing, none = Interval(), np.zeros(0)
        >>> short = Report(Verdict.NOT_ENOUGH_DATA, "drive longer", "pedal", none, none, none > 0, no_fit(0), no_fit(0),
        ...     (), nothing, nothing, (), 0, (), (), (), (), (), (), None, (), {}, (), ())
        >>> "drive longer" in page(short)
        True
    """
    parameters = known_parameters(report)
    at_bound = partial(search_bounds.of_parameter, half_step=0.5 * step(report))
    bounded = any(at_bound(key, iv) for key, pair in parameters.items() for iv in pair)
    bounded = bounded or any(search_bounds.of_finding(finding) for finding in report.findings)
    drawn = (
        whole_drive(report),
        worst_windows(report),
        *heat_maps(report),
        spectra(report),
        evidence_plot(report),
        trajectories(report),
    )
    figures = [figure for figure in drawn if figure is not None]
    plotly = _plotly() if figures else None
    return (
        environment()
        .get_template("report/page.html.j2")
        .render(
            report=report,
            title=TITLES[report.verdict],
            unit=role_unit(report.output),
            sentence=sentence(report),
            parameters=parameters,
            equation="" if report.model is None else equation(report.model),
            advice=advice(report),
            duration=duration(report),
            used_time=used_time(report),
            extends=extends,
            closed_loop_models=closed_loop_models,
            recommendation=recommendation,
            form=form,
            gains=gains,
            figures={figure.name: figure for figure in figures},
            map_names=[f"map-{k + 1}" for k in range(len(report.maps))],
            outcome=lambda row: SYMBOLS[outcome(row, report)].label,
            remarks=remarks(report),
            # the title names the causes of the verdict, and of these what no other block's cause is a surrogate for
            named=[finding for finding in report.findings if not finding.surrogate],
            time=signal_text.time,
            signals=signal_text.findings,
            change=change,
            errors=errors,
            worse=worse,
            loop_extended=any(map(has_extended, report.closed_loop)),
            finding_parameters=finding_parameters,
            block_says=lambda block: block_says(block, report),
            finding_says=lambda finding: search_bounds.without_intervals(finding.says, report),
            estimate=lambda key, iv: estimate(key, iv, report),
            at_bound=at_bound,
            bounds_of=search_bounds.of_finding,
            bounded_text=search_bounds.text,
            bounded=bounded,
            not_quoted=not_quoted(report),
            model_units=model_units(report),
            model_bounds=model_bounds(report),
            gain_unit=gain_unit,
            parameter=parameter,
            shift=shift,
            forest_plot=forest_plot,
            time_range=time_range,
            role_unit=role_unit,
            plotly=plotly,
            specs=Markup(script(figures)),
            style=file_text("report/page.css"),
            script=file_text("report/page.js"),
        )
    )


def _plotly() -> Markup | None:
    """plotly.js of the installed package; None without one."""
    if find_spec("plotly") is None:
        return None
    from plotly.offline import get_plotlyjs

    return Markup(get_plotlyjs())
