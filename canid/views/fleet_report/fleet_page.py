"""A fleet as one self-contained HTML page without scripts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from canid.findings import Provenance
from canid.fleet_summary import Driver, FleetSummary, Parameter, Population, Questions
from canid.types import Interval
from canid.views.comparison_text import p_text
from canid.views.fleet_report.driver_plot import (
    AT_EACH_END,
    MAX_DRIVERS,
    distribution,
    driver_plot,
    ranked,
)
from canid.views.fleet_report.labels import label, short, spread, unit
from canid.views.report.templates import environment, file_text

# rows of a table; the Parquet files have all
MAX_ROWS = 25
# kinds of output that are shown in full: a fleet of pedals has one for each car
MAX_KINDS = 4
# parameters of a table of drivers: what fits next to each other
MAX_COLUMNS = 4
# characters of a log's name
MAX_LOG_NAME = 80


class _Drawn(NamedTuple):
    """One parameter of the drivers."""

    title: str
    drivers: Markup
    distribution: Markup


class _Shown(NamedTuple):
    """One kind of output."""

    anchor: str
    of: Population
    parameters: tuple[Parameter, ...]  # those that any drive knows
    drawn: tuple[_Drawn, ...]
    further: tuple[_Drawn, ...]  # lag and dead time apart, folded
    columns: tuple[Parameter, ...]  # of the table of drivers
    drivers: tuple[Driver, ...]
    left_out: int
    questions: tuple[Questions, ...]
    says: tuple[tuple[str, list[str]], ...]  # what is not known, and of which parameters


def page(of: FleetSummary, provenance: Provenance) -> str:
    """The page, to be stored as UTF-8.

    Args:
        of: the fleet.
        provenance: of its folder, and the command.
    """
    templates = environment()
    templates.filters.update(
        capitalize_first=_capitalized,
        label=label,
        p_text=p_text,
        spread_text=spread,
        short=short,
        sentence=_sentence,
        hours=_hours,
    )
    templates.globals.update(unit=unit, known=_known)
    return templates.get_template("fleet_report/fleet.html.j2").render(
        of=of,
        shown=[_shown(one, k) for k, one in enumerate(of.populations[:MAX_KINDS])],
        kinds_left_out=of.populations[MAX_KINDS:],
        rows=MAX_ROWS,
        at_each_end=AT_EACH_END,
        max_drivers=MAX_DRIVERS,
        name_length=MAX_LOG_NAME,
        p=provenance,
        style=file_text("report/page.css")
        + file_text("comparison_report/comparison.css")
        + file_text("fleet_report/fleet.css"),
    )


def _shown(of: Population, number: int) -> _Shown:
    parameters = tuple(one for one in of.parameters if one.drives)
    main = [one for one in parameters if not _apart(one.name)]
    order = ranked(of, main[0].name if len(main) < 2 else main[1].name) if main else []
    names = {driver.name for driver in order}
    order += [driver for driver in of.drivers if driver.name not in names]
    left_out = max(len(order) - MAX_DRIVERS, 0)
    if left_out:
        left_out = len(order) - 2 * AT_EACH_END
        order = order[:AT_EACH_END] + order[-AT_EACH_END:]
    return _Shown(
        f"kind-{number + 1}",
        of,
        parameters,
        tuple(_drawn(of, one) for one in main),
        tuple(_drawn(of, one) for one in parameters if _apart(one.name)),
        tuple(main[:MAX_COLUMNS]),
        tuple(order),
        left_out,
        tuple(one for one in of.questions if one.asked or one.says),
        tuple(_lacking(parameters).items()),
    )


def _lacking(parameters: Sequence[Parameter]) -> dict[str, list[str]]:
    """What the drives do not show -> parameters."""
    out: dict[str, list[str]] = {}
    for one in parameters:
        if one.says:
            out.setdefault(one.says, []).append(label(one.name))
    return out


def _drawn(of: Population, parameter: Parameter) -> _Drawn:
    named = unit(parameter.name, of.kind)
    title = label(parameter.name) + (f", {named}" if named else "")
    return _Drawn(title, driver_plot(of, parameter), distribution(of, parameter))


def _apart(name: str) -> bool:
    """Lag or dead time alone: known from few drives, and in their sum already."""
    return name.rpartition(".")[2] in ("log_tau", "dead_time")


def _sentence(text: str) -> str:
    """With a capital and a full stop."""
    text = text.strip()
    return _capitalized(text) + ("" if text.endswith((".", "!", "?")) else ".") if text else ""


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]


def _hours(seconds: float) -> str:
    """A duration.

    >>> _hours(900.0), _hours(7200.0), _hours(3.6e6)
    ('15 min', '2.0 h', '1,000 h')
    """
    if seconds < 3600.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:,.1f} h" if seconds < 360_000.0 else f"{seconds / 3600.0:,.0f} h"


def _known(iv: Interval) -> bool:
    return math.isfinite(iv.value)
