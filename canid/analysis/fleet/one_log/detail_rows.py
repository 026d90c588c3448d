"""Rows of one drive's windows, events, findings and power."""

from __future__ import annotations

import json
from collections.abc import Sequence

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_reader import Health
from canid.analysis.fleet.one_log.drive_row import changes
from canid.analysis.fleet.one_log.monitor_misfits import Misfit
from canid.analysis.fleet.one_log.plain_values import Row, channel_columns, interval_columns
from canid.mathematics.estimators import step_watch
from canid.values.findings import Report
from canid.values.text import json_values
from canid.values.text.json_values import number
from canid.values.types import Estimate


def window_rows(estimates: Sequence[Estimate]) -> list[Row]:
    """One row per window and estimator."""
    return [
        {
            "t": number(e.t),
            "estimator": e.estimator,
            "headline": bool(e.headline),
            "status": e.status.value,
            "used": number(e.used),
            "fit_percent": number(e.fit_percent),
            **channel_columns(e.channels),
        }
        for e in estimates
    ]


def event_rows(identified: Identified, health: Health, misfits: Sequence[Misfit]) -> list[Row]:
    """What happened during the drive, and what was wrong with its log, in the order of time; without a time first."""
    rows = [_event(misfit.since, "monitor", misfit.block, misfit.until, misfit.says) for misfit in misfits]
    rows += [
        _event(change.t.value, "gain_step", "", None, step_watch.says(change))
        for change in changes(identified)
    ]
    rows += [
        _event(finding.since, "signal", finding.name, finding.until, finding.says)
        for finding in identified.findings
    ]
    rows += [_event(event.t, "bus", event.what, event.t, event.says) for event in health.events]
    if health.damage:
        rows.append(_event(None, "damage", "unreadable", None, health.damage.says))
    if health.back_in_time:
        rows.append(_event(None, "damage", "back_in_time", None, health.back_in_time))
    return sorted(rows, key=lambda row: (row["t"] is not None, row["t"] or 0.0))


def _event(t: float | None, kind: str, name: str, until: float | None, says: str) -> Row:
    times = {"t": None if t is None else number(t), "until": None if until is None else number(until)}
    return {**times, "kind": kind, "name": name, "says": says}


def finding_rows(report: Report) -> list[Row]:
    """One row per cause that the diagnosis states."""
    return [
        {
            "effect": f.effect,
            "where": f.where,
            "rivals": list(f.rivals),
            "surrogate": bool(f.surrogate),
            "parameters": json.dumps(
                {
                    name: {**json_values.plain(interval), "unit": f.units.get(name, "")}
                    for name, interval in f.parameters.items()
                },
                ensure_ascii=False,
            ),
            **interval_columns("gain", f.gain),
            **interval_columns("log_score_gain", f.log_score_gain),
            "says": f.says,
        }
        for f in report.findings
    ]


def power_rows(report: Report) -> list[Row]:
    """One row per effect that was not named, with the strength from which on it would have been."""
    return [
        {
            "effect": visible.effect,
            "parameter": visible.parameter,
            "strength": number(visible.strength),
            "unit": visible.unit,
        }
        for visible in report.visible
    ]
