"""Results of identify, diagnose and compare as fragments."""

from __future__ import annotations

import numpy as np

from canid.comparison.comparison import Comparison
from canid.drive_parameters import Identified
from canid.findings import Report
from canid.types import QUOTED, Status
from canid.views import comparison_text, diagnosis_text, identification_summary
from canid.views.identification_verdict import verdict
from canid.views.names import readable
from canid.views.notebook.channel_rows import channel_table
from canid.views.notebook.fragment import ACCENT, SECOND, bar, chart, fragment, legend, lines, scale, table
from canid.views.numbers import gain_unit, interval, number, role_unit


def identified_lines(of: Identified) -> list[str]:
    """The text of `canid identify`."""
    log, vehicle = of.log or "drive", of.vehicle or "vehicle not named"
    return identification_summary.summary(of, log, vehicle, of.drive_summary.output)


def identified_html(of: Identified) -> str:
    """The headline's parameters, and its gain over the windows of the drive."""
    said = verdict(of, of.drive_summary.output)
    about = f"{of.log or 'drive'}: {number(of.driver_time, 's')} usable of {number(of.duration, 's')}"
    return fragment(
        f"{said.title}",
        lines([about]),
        channel_table(of.channels, of.drive_summary.output),
        _gains(of),
        lines([said.withheld, *(one.says for one in of.findings)]),
    )


def _gains(of: Identified) -> str:
    """K over the windows, of the input whose gain is known best."""
    known = {name: ch.K for name, ch in of.channels.items() if "K" in QUOTED[ch.status]}
    name = min(
        known, key=lambda one: (known[one].high - known[one].low) / abs(known[one].value or 1e-9), default=""
    )
    estimator = of.ranked[0] if of.whole else ""
    windows = [
        e for e in of.windows if e.estimator == estimator and e.status is Status.OK and name in e.channels
    ]
    if not name or len(windows) < 2:
        return ""
    t = np.array([e.t for e in windows])
    K = np.array([e.channels[name].K for e in windows])
    edges = [
        (label, K[:, k], color)
        for label, k, color in (("low", 1, SECOND), ("high", 2, SECOND), ("K", 0, ACCENT))
    ]
    key = [
        (f"K of {readable(name)} in windows ({gain_unit(of.drive_summary.output, name)})", ACCENT),
        ("95 %", SECOND),
    ]
    return f"<div>{legend(key)}</div>{chart(t, edges)}"


def report_lines(of: Report) -> list[str]:
    """The text of `canid diagnose`."""
    return diagnosis_text.text(of, of.provenance.log or "drive", of.provenance.vehicle or "vehicle not named")


def report_html(of: Report) -> str:
    """Verdict, findings, and measured against simulated output."""
    found = [(readable(f.effect), f.where, "surrogate" if f.surrogate else "", f.says) for f in of.findings]
    curves = [("measured", of.measured, SECOND), ("simulated", of.extended.simulated, ACCENT)]
    unit = role_unit(of.output)
    return fragment(
        f"Diagnosis: {readable(of.verdict.value)}",
        lines([of.says]),
        table(("finding", "in", "", ""), found) if found else "",
        f"<div>{legend([(f'measured {readable(of.output)} ({unit})', SECOND), ('simulated', ACCENT)])}</div>",
        chart(of.t, curves),
        channel_table(of.extended.channels, of.output),
    )


def comparison_html(of: Comparison) -> str:
    """Every compared parameter of both sides."""
    rows = []
    for row in of.rows:
        if row.compared:
            low, high = scale([row.a, row.b])
            name = comparison_text.label(row.name)
            cells = [bar(side, low, high, f"{name} {interval(side, row.unit)}") for side in (row.a, row.b)]
            differs = "differs" if row.differs else ""
            rows.append((name, interval(row.a), cells[0], interval(row.b), cells[1], row.unit, differs))
    head = ("parameter", *(cell for side in (of.a, of.b) for cell in (side.label, "")), "", "")
    said = comparison_text.sentence(of)
    title = f"Comparison: {comparison_text.TITLES[of.verdict]}"
    return fragment(title, lines([said]), table(head, rows), lines(of.remarks))
