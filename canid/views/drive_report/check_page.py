"""The check of a vehicle file against a log as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from canid.findings import Provenance
from canid.types import Signal
from canid.vehicle_check import Check, Row
from canid.views import signal_text
from canid.views.drive_report import enough, gates, page_parts
from canid.views.drive_report.panels import Panel, instants, signal, stack
from canid.views.drive_report.strips import strips
from canid.views.names import readable
from canid.views.numbers import number, role_unit
from canid.views.report.figure import Figure, Spec, times

# points of a line: a log has some ten roles
MAX_POINTS = 3000
PANEL_PX = 78
# changes of the lead that are drawn, and marks of readings that were left out: more are a band of ink
MAX_CHANGES_DRAWN, MAX_MARKS = 40, 400
# significant digits: enough to see an offset of 0.1 in 100
TABLE_DIGITS = 4
# share of the time from which on a role that is stale is marked
MARKED_STALE_PERCENT = 1.0
# ids that are listed without a click
IDS_SHOWN = 12


class CheckedLog(NamedTuple):
    """A check, as the page shows it."""

    check: Check
    step: float  # s, of the samples
    health: Sequence[str]  # what was wrong with the log, sentences
    provenance: Provenance
    vehicle: str  # its name
    damaged: bool = False


def page(log: CheckedLog) -> str:
    """The page.

    Args:
        log: a check.

    Returns:
        The page, to be stored as UTF-8.
    """
    found = log.check
    span = (0.0, max(found.duration, 1.0))
    signals = _signals(found, span)
    gate = strips(
        "gate",
        "The learning gate",
        "used: would be learned from; settling: the seconds after the gate's opening.",
        gates.gate_strip(found.gate.t, found.gate.gate, found.gate.learn, found.findings, log.step),
        span,
    )
    count = len(found.problems)
    return page_parts.render(
        "check.html.j2",
        [signals, gate],
        found=found,
        title=f"{count} problem{'s' * (count > 1)}" if count else "The vehicle file fits",
        fits=not count,
        summary=_summary(found),
        rows=[_row(row, found.left_out.get(row.role, {})) for row in found.rows],
        needs=enough.needs(found.time, found.output),
        chosen=[role for role in found.signals if role not in {row.role for row in found.rows}],
        signals=signals,
        gate=gate,
        gate_times=gates.gate_times(found.gate.gate, log.step),
        time=signal_text.time(found.time),
        health=log.health,
        damaged=log.damaged,
        vehicle=log.vehicle,
        provenance=log.provenance,
        ids_shown=IDS_SHOWN,
    )


def _summary(found: Check) -> str:
    came = sum(row.readings > 0 for row in found.rows)
    return (
        f"{came} of {len(found.rows)} mapped roles came, in {found.frames:,} frames of {len(found.ids)} ids over "
        f"{number(found.duration, 's')}; {number(found.time.usable, 's')} are usable for identification."
    )


def _row(row: Row, left_out: Mapping[str, int]) -> dict[str, Any]:
    """One role of the table."""
    stale = row.stale_percent
    state = "found"
    if not row.readings:
        state = "never came"
    elif row.missing_percent == 100.0:
        state = "never valid"
    elif stale > MARKED_STALE_PERCENT:
        state = "with gaps"
    return {
        "role": readable(row.role),
        "unit": role_unit(row.role),
        "source": row.source,
        "state": state,
        "readings": f"{row.readings:,}",
        "rate": number(row.rate, digits=TABLE_DIGITS),
        "range": f"{number(row.low, digits=TABLE_DIGITS)} to {number(row.high, digits=TABLE_DIGITS)}",
        "median": number(row.median, digits=TABLE_DIGITS),
        "missing": number(row.missing_percent, "%"),
        "why": _why(left_out),
        "gap": number(row.longest_gap, "s"),
        "stale": number(stale, "%"),
    }


def _why(left_out: Mapping[str, int]) -> str:
    """Reasons for readings without a value."""
    return ", ".join(f"{why} {n:,} times" for why, n in left_out.items())


def _signals(found: Check, span: tuple[float, float]) -> Figure | None:
    """The decoded signals, one panel each."""
    panels = [
        _panel(role, of, found.left_out.get(role, {}))
        for role, of in found.signals.items()
        if np.isfinite(of.value).any()
    ]
    if not panels:
        return None
    longest = max(len(of.t) for of in found.signals.values())
    thinned = (
        f" Lines are thinned to the extremes of each bucket, {MAX_POINTS:,} points of up to {longest:,} readings."
        if longest > MAX_POINTS
        else ""
    )
    few = len(found.lead_changes) <= MAX_CHANGES_DRAWN
    shapes = instants([(t, "") for t in found.lead_changes], "muted")[0] if few else []
    changed = " Dashed: another vehicle ahead." if shapes else ""
    return stack(
        "signals",
        "Decoded signals",
        "As they came, decoded and converted. A mark below a line is a reading that was left out, for the reason in the "
        f"panel's title.{changed}{thinned}",
        panels,
        span=span,
        shapes=shapes,
    )


def _panel(role: str, of: Signal, left_out: Mapping[str, int]) -> Panel:
    unit = role_unit(role)
    values = of.value[np.isfinite(of.value)]
    switch = not unit and set(np.unique(values).tolist()) <= {0.0, 1.0}
    line = signal(of.t, of.value, readable(role), "after", MAX_POINTS, showlegend=False)
    if switch:
        line = line | {"line": {"color": "@after", "width": 1.2, "shape": "hv"}}
    title = f"{readable(role)} ({unit})" if unit else readable(role)
    if why := _why(left_out):
        # the reason may be a text of a value table, and plotly reads marks of HTML in titles
        title += f" · left out: {escape(why, quote=False)}"
    return Panel(
        title,
        [line, *_marks(of, readable(role), 0.0 if switch else float(values.min()))],
        PANEL_PX // 2 if switch else PANEL_PX,
        (-0.15, 1.15) if switch else None,
        {"tickvals": [0, 1], "ticktext": ["off", "on"]} if switch else {"nticks": 4},
    )


def _marks(of: Signal, name: str, at: float) -> list[Spec]:
    """Where readings were left out: a mark at the lower end of the panel for each, or for one of several."""
    lost = of.t[~np.isfinite(of.value)]
    if not lost.size:
        return []
    lost = lost[:: -(-lost.size // MAX_MARKS)]
    return [{
        "type": "scatter", "mode": "markers", "x": times(lost), "y": [at] * lost.size, "name": f"{name}, left out",
        "marker": {"symbol": "line-ns-open", "size": 5, "color": "@muted"}, "showlegend": False, "hoverinfo": "skip",
    }]  # fmt: skip
