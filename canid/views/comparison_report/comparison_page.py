"""A comparison of two drivers as one self-contained HTML page without scripts."""

from __future__ import annotations

import math

from canid.comparison.comparison import Comparison
from canid.findings import Provenance
from canid.views.comparison_report.forest import forest
from canid.views.comparison_report.levels import levels
from canid.views.comparison_text import (
    TITLES,
    by_ratio,
    condition_name,
    label,
    p_text,
    range_text,
    refused,
    sentence,
)
from canid.views.report.templates import environment, file_text


def page(of: Comparison, provenance: Provenance) -> str:
    """The page, to be stored as UTF-8.

    Args:
        of: the comparison.
        provenance: of its files, and the command.

    Example:
        >>> from canid.comparison.drive import Side
        >>> nothing = Comparison(Side("A", ()), Side("B", ()), "not_comparable", (), (), (), (), 0.0, None)
        >>> "No parameter is known on both sides" in page(nothing, Provenance())
        True
    """
    templates = environment()
    templates.filters.update(
        by_ratio=by_ratio,
        label=label,
        p_text=p_text,
        condition=condition_name,
        span=range_text,
        capitalize_first=_capitalized,
    )
    compared = [row for row in of.rows if row.compared]
    return templates.get_template("comparison_report/comparison.html.j2").render(
        of=of,
        title=TITLES[of.verdict],
        sentence=sentence(of),
        compared=compared,
        spread=[row for row in compared if math.isfinite(row.spread)],
        refused=refused(of),
        forest=forest(compared),
        levels=levels(of),
        p=provenance,
        style=file_text("report/page.css") + file_text("comparison_report/comparison.css"),
    )


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]
