"""Report → page: the figures, the tables and what they need, put into one HTML text that loads nothing."""

from __future__ import annotations

from importlib.resources import files
from importlib.util import find_spec

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from canid.findings import Report, Verdict
from canid.views.diagnosed import advice, duration, sentence, told, used_time
from canid.views.measures import (
    either,
    measure,
    number,
    percent,
    role_unit,
    shifted,
    spoken,
    stretch,
)
from canid.views.report.figure import script
from canid.views.report.frequency import frequency
from canid.views.report.ladder import OUTCOMES, ladder
from canid.views.report.maps import maps
from canid.views.report.strip import strip, windows
from canid.views.report.trajectories import trajectories
from canid.views.report.whiskers import shift, whiskers

TITLES = {
    Verdict.ADEQUATE: "The simulation is adequate",
    Verdict.NAMED: "A cause is named",
    Verdict.ONE_OF: "One of these causes",
    Verdict.UNEXPLAINED: "Unexplained",
    Verdict.NOT_ENOUGH_DATA: "Not enough data",
}


def page(report: Report) -> str:
    """Write the diagnosis as one HTML page.

    Nothing is loaded from anywhere: style, script and data stand in it. Plots are drawn by the plotly.js of the installed
    plotly package; without that package the page has its words and tables, and says how to get the plots.

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
    drawn = (
        strip(report),
        windows(report),
        *maps(report),
        frequency(report),
        ladder(report),
        trajectories(report),
    )
    figures = [figure for figure in drawn if figure is not None]
    plotly = _plotly() if figures else None
    environment = Environment(
        loader=PackageLoader("canid.views.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(measure=measure, percent=percent, number=number, spoken=spoken, either=either)
    return environment.get_template("page.html.j2").render(
        report=report,
        title=TITLES[report.verdict],
        unit=role_unit(report.output),
        sentence=sentence(report),
        shifts=told(report),
        advice=advice(report),
        duration=duration(report),
        used_time=used_time(report),
        figures={figure.name: figure for figure in figures},
        map_names=[f"map-{k + 1}" for k in range(len(report.maps))],
        outcomes={name: says for name, (_, says) in OUTCOMES.items()},
        shifted=shifted,
        shift=shift,
        whiskers=whiskers,
        stretch=stretch,
        role_unit=role_unit,
        plotly=plotly,
        specs=Markup(script(figures)),
        style=_text("page.css"),
        script=_text("page.js"),
    )


def _text(name: str) -> Markup:
    """Style and script, which come with canid."""
    return Markup(files("canid.views.report").joinpath(name).read_text(encoding="utf-8"))


def _plotly() -> Markup | None:
    """plotly.js as the installed package brings it; None where there is none."""
    if find_spec("plotly") is None:
        return None
    from plotly.offline import get_plotlyjs

    return Markup(get_plotlyjs())
