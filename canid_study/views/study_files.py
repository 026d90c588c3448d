"""A study as JSON, CSV tables and plain text."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from typing import NamedTuple

from canid.ui.views.document.document_text import wrapped
from canid.values.text.numbers import DASH
from canid_study.artifact import Cell, Study, Table

# significant digits of a number in a table of the page; the CSV and JSON have all
DIGITS = 4
# smaller numbers are rounding: nothing in a study is measured in such units
ROUNDING = 1e-9


class Studied(NamedTuple):
    """The object of `canid study --json`. Figures hold the data that are drawn."""

    canid_study: int
    command: str
    study: Study
    settings: Mapping[str, str]


def document(study: Study, command: str = "") -> Studied:
    """What `canid study` writes of one paper."""
    return Studied(1, command, study, dict(study.settings))


def to_csv(table: Table) -> str:
    r"""A table as CSV; its first line names the columns, and nothing is an empty cell.

    Example:
        >>> to_csv(Table("table_1", "", ("a", "b (s)"), [(1.5, None)]))
        'a,b (s)\n1.5,\n'
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(table.columns)
    for row in table.rows:
        writer.writerow(["" if x is None or (isinstance(x, float) and math.isnan(x)) else x for x in row])
    return out.getvalue()


def cell(value: Cell) -> str:
    """One cell of a table as text.

    Example:
        >>> cell(0.123456), cell(float("nan")), cell(12), cell(-1033.9), cell("yes")
        ('0.1235', '–', '12', '-1034', 'yes')
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        text = f"{value:.{DIGITS}g}" if abs(value) > ROUNDING else "0"
        return f"{value:.0f}" if "e+0" in text and abs(value) < 1e6 else text
    return str(value)


def text(study: Study) -> list[str]:
    """The study in lines of a terminal: result, what was skipped, and each artifact with its numbers.

    Example:
        >>> text(Study("Grover 2021", "Grover 2021: prints", ("Two claims fail.",), ()))
        ['Grover 2021: prints', 'Two claims fail.']
    """
    lines = [line for says in (study.title, *study.says) for line in wrapped(says)]
    for entry in study.skipped:
        lines += wrapped(f"skipped: {entry.log}, {entry.what}: {entry.why}")
    for a in study.artifacts:
        lines += wrapped(f"{a.name}: {a.verdict.value}: {a.what}")
        numbers = (
            ("published", a.published),
            ("recomputed", a.reproduced),
            ("canid", a.corrected),
            ("why", a.why),
        )
        lines += [
            line for name, says in numbers if says for line in wrapped(f"  {name}: {says}", hang="    ")
        ]
    lines += [line for claim in study.failed for line in wrapped(f"missed: {claim}")]
    return lines
