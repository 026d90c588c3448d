"""The row of one drive: what identification and diagnosis found over the whole of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from canid.analysis.drive import identification_json
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_reader import Health
from canid.analysis.fleet.one_log.joint_estimate import joint_estimate
from canid.analysis.fleet.one_log.plain_values import Row, channel_columns, interval_columns
from canid.signals.vehicle import Vehicle
from canid.values.findings import Report
from canid.values.text import json_values
from canid.values.text.json_values import number
from canid.values.text.numbers import role_unit
from canid.values.types import Interval

# roles whose range is stated
_DRIVEN = ("speed", "headway", "gap")
# inputs whose excitation is stated
_EXCITED = ("headway_error", "range_rate")


def read_columns(health: Health, vehicle: Vehicle, start_utc: float) -> Row:
    """What reading the log has shown."""
    return {
        "vehicle": vehicle.name,
        "start_utc": number(start_utc),
        "frames": health.frames,
        "task": vehicle.driver.task,
        "missing": list(health.missing),
        "counters": json.dumps(health.counters, ensure_ascii=False),
    }


def identified_columns(identified: Identified, vehicle: Vehicle) -> Row:
    """What identification found."""
    summary, time = identified.drive_summary, identified.time
    output = summary.output or vehicle.driver.output
    joint = joint_estimate(identified)
    row: Row = {
        "duration": number(identified.recorded),
        "driving": number(time.driving),
        "behind_lead": number(time.behind_lead),
        "usable": number(time.usable),
        "output": output,
        "unit": role_unit(output),
        "estimator": identified.ranked[0] if identified.headline is not None else None,
        **channel_columns(identified.channels),
        "fit_percent": number(identified.fit_percent),
        **interval_columns("noise_sd", summary.noise_sd),
        **interval_columns("wanted_headway", summary.wanted_headway),
        "gain_steps": len(changes(identified)),
        "names": None if joint is None else list(joint.names),
        "estimate": None if joint is None else joint.mean.tolist(),
        "covariance": None if joint is None else joint.covariance.ravel().tolist(),
        "signal_findings": list(dict.fromkeys(finding.name for finding in identified.findings)),
        "identify_json": _identify_json(identified, vehicle.name),
    }
    for role in _DRIVEN:
        row |= interval_columns(role, summary.driven.get(role, Interval()))
    for name in _EXCITED:
        row[f"excitation_{name}"] = number(summary.excitation[name]) if name in summary.excitation else None
    return row


def changes(identified: Identified) -> tuple[Any, ...]:
    """The steps of the gains that the estimator with the headline found, or another one."""
    named = [identified.whole[name] for name in identified.ranked] if identified.whole else []
    steps = [tuple(result.details.get("changes", ())) for result in named if result is not None]
    return next((several for several in steps if several), ())


def diagnosed_columns(report: Report) -> Row:
    """What the diagnosis found."""
    return {
        "verdict": report.verdict.value,
        "says": report.says,
        "causes": [finding.effect for finding in report.findings if not finding.surrogate],
        "baseline_fit": number(report.baseline.fit_percent),
        "extended_fit": number(report.extended.fit_percent),
        **interval_columns("gain", report.gain),
        **interval_columns("unexplained", report.unexplained),
    }


def _identify_json(identified: Identified, vehicle: str) -> str:
    """The JSON of `canid identify`, without windows, draws and the log's name: logs of the same bytes share it."""
    whole: Mapping[str, Any] = identification_json.to_json(
        identified._replace(windows=(), drive_summary=identified.drive_summary._replace(draws=None)),
        "",
        vehicle,
    )
    return json_values.document("identify", dict(whole))
