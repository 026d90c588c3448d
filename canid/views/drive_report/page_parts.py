"""What the pages of identify, check and replay share: plotly.js, style, scripts, and rendering."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from markupsafe import Markup

from canid.views.report.figure import Figure, script
from canid.views.report.templates import environment, file_text


def render(template: str, figures: Sequence[Figure | None], **values: Any) -> str:
    """A page from its template; `figures` are all that it has."""
    drawn = [figure for figure in figures if figure is not None]
    plotly = plotly_script() if drawn else None
    return (
        environment()
        .get_template(f"drive_report/{template}")
        .render(
            plotly=plotly,
            specs=Markup(script(drawn)),
            style=file_text("report/page.css") + file_text("drive_report/drive_report.css"),
            script=file_text("report/page.js"),
            **values,
        )
    )


def plotly_script() -> Markup | None:
    """plotly.js of the installed package; None without one."""
    if find_spec("plotly") is None:
        return None
    from plotly.offline import get_plotlyjs

    return Markup(get_plotlyjs())
