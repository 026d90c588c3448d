"""The row of one drive: what identification and diagnosis found over the whole of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from canid.drive_parameters import Identified
from canid.drive_reader import Health
from canid.findings import Report
from canid.fleet.joint_estimate import joint_estimate
from canid.fleet.plain_values import Row, channel_columns, interval_columns
from canid.types import Interval
from canid.vehicle import Vehicle
from canid.views import identification_json, json_values
from canid.views.json_values import number
from canid.views.numbers import role_unit

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


def identified_columns(found: Identified, vehicle: Vehicle) -> Row:
    """What identification found."""
    of, time = found.drive_summary, found.time
    output = of.output or vehicle.driver.output
    joint = joint_estimate(found)
    row: Row = {
        "duration": number(found.duration),
        "driving": number(time.driving),
        "behind_lead": number(time.behind_lead),
        "usable": number(time.usable),
        "output": output,
        "unit": role_unit(output),
        "estimator": found.ranked[0] if found.headline is not None else None,
        **channel_columns(found.channels),
        "fit_percent": number(found.fit_percent),
        **interval_columns("noise_sd", of.noise_sd),
        **interval_columns("wanted_headway", of.wanted_headway),
        "gain_steps": len(changes(found)),
        "names": None if joint is None else list(joint.names),
        "estimate": None if joint is None else joint.mean.tolist(),
        "covariance": None if joint is None else joint.covariance.ravel().tolist(),
        "signal_findings": list(dict.fromkeys(one.name for one in found.findings)),
        "identify_json": _identify_json(found, vehicle.name),
    }
    for role in _DRIVEN:
        row |= interval_columns(role, of.driven.get(role, Interval()))
    for name in _EXCITED:
        row[f"excitation_{name}"] = number(of.excitation[name]) if name in of.excitation else None
    return row


def changes(found: Identified) -> tuple[Any, ...]:
    """The steps of the gains that the estimator with the headline found, or another one."""
    named = [found.whole[name] for name in found.ranked] if found.whole else []
    steps = [tuple(one.details.get("changes", ())) for one in named if one is not None]
    return next((one for one in steps if one), ())


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


def _identify_json(found: Identified, vehicle: str) -> str:
    """The JSON of `canid identify`, without windows, draws and the log's name: logs of the same bytes share it."""
    whole: Mapping[str, Any] = identification_json.to_json(
        found._replace(windows=(), drive_summary=found.drive_summary._replace(draws=None)), "", vehicle
    )
    return json_values.document("identify", dict(whole))
