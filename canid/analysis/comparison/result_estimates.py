"""A drive as a comparison takes it, from the result of identify or diagnose."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from canid.analysis.comparison.drive import (
    FIELDS,
    Causes,
    Correlation,
    Draws,
    DriveEstimates,
    Effect,
    Level,
    Loop,
    Quantity,
    finite,
)
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.identification_json import short_draws
from canid.mathematics.systems.identified_loop import IdentifiedLoop
from canid.mathematics.systems.posterior_draws import Drawn
from canid.values.findings import Finding, Report, duration, used_time
from canid.values.identified_model import IdentifiedModel
from canid.values.types import NAN, QUOTED, TASK_INPUTS, Channel, Identifiable, Interval

# fields that the status of a channel allows to be quoted
_QUOTED = {**QUOTED, Identifiable.OK: FIELDS}
# names of a diagnosis' model, and what they are called here
_MODEL_NAMES = {
    f"{field}{i}": f"{name} {field}"
    for i, name in enumerate(TASK_INPUTS["car_following"], 1)
    for field in ("K", "tau", "dead_time")
}
# unit of an input; of one that is not here the gain has the output's unit per unit of the input
_INPUT_UNITS = {"headway_error": "s", "range_rate": "m/s", "lateral_offset": "m"}
NOT_IDENTIFIABLE = "not identifiable"


def of_identified(result: Identified, name: str, vehicle: str, unit: str) -> DriveEstimates:
    """Take what `identify` found on one drive.

    Args:
        result: of the drive.
        name: of the drive.
        vehicle: its name.
        unit: of the driver's output; "": not known, then gains are not compared.

    Example:
        >>> iv = Interval(5.0, 4.0, 6.0)
        >>> from canid.mathematics.estimators.estimator import WholeDrive
        >>> whole = {"fopdt": WholeDrive({"range_rate": Channel(iv, iv, iv, iv, Identifiable.GAIN_ONLY)})}
        >>> drive = of_identified(Identified(400.0, 300.0, (), whole, ()), "a.blf", "car", "%")
        >>> drive.quantities["range_rate K"].value.high, drive.quantities["range_rate tau"].why
        (6.0, 'not identifiable')
    """
    whole, summary = result.headline, result.drive_summary
    details = whole.details if whole is not None else {}
    changes = tuple(change.t.value for change in details.get("changes") or ())
    why = changed = ""
    if changes:
        times = ", ".join(f"{t:.0f}" for t in changes)
        changed = f"the gains changed during the drive, at {times} s: compare the parts between"
    why = changed or (NOT_IDENTIFIABLE if whole is not None else "no model of the whole drive")
    quantities = _channels(whole.channels if whole is not None else {}, unit, why)
    noise, wanted = _known(summary.noise_sd), _known(summary.wanted_headway)
    if quantities:
        too_short = "" if finite(noise) else "the drive is too short for an interval"
        quantities["noise_sd"] = Quantity(noise, unit, too_short or _gain_unknown(unit) or changed)
    if finite(wanted):
        quantities["wanted_headway"] = Quantity(wanted, "s", changed)
    fopdt = bool(result.whole) and result.ranked[0] == "fopdt"
    return DriveEstimates(
        name=name,
        method="identify",
        vehicle=vehicle,
        output=summary.output,
        used=result.driver_time,
        quantities=quantities,
        driven={role: _known(iv) for role, iv in summary.driven.items()},
        excitation=summary.excitation,
        draws=_draws(summary.draws) if fopdt and not changes else None,
        loop=_loop(result.loop),
        levels=tuple(map(_level, details.get("constancy") or ())),
        changes=changes,
        duration=result.duration,
    )


def of_report(report: Report, name: str, vehicle: str, unit: str) -> DriveEstimates:
    """Take what `diagnose` found on one drive; the arguments are those of `of_identified`."""
    fit, model = report.extended, report.model
    quantities = _channels(fit.channels, unit, NOT_IDENTIFIABLE)
    if quantities:
        noise = Interval(fit.noise_sd if math.isfinite(fit.noise_sd) else NAN)
        quantities["noise_sd"] = Quantity(noise, unit, "a diagnosis gives no interval of it")
    if fit.form is not None:
        for parameter, value in fit.form.parameters.items():
            # the same symbol means another thing in another form
            key = f"{fit.form.name} {parameter}"
            quantities[key] = Quantity(_known(value), fit.form.units.get(parameter, ""))
    driven = model.driven if model is not None else {}
    return DriveEstimates(
        name=name,
        method="diagnose",
        vehicle=vehicle,
        output=report.output,
        used=used_time(report),
        quantities=quantities,
        driven={role: _known(iv) for role, iv in driven.items() if role != "range_rate"},
        correlation=_correlation(model) if model is not None else None,
        duration=duration(report),
        causes=Causes(
            report.verdict.value,
            tuple(map(_effect, report.findings)),
            {
                visible.effect: (visible.parameter, visible.strength, visible.unit)
                for visible in report.visible
            },
            frozenset(entry.effects[0] for entry in report.not_testable if len(entry.effects) == 1),
        ),
    )


def _channels(channels: Mapping[str, Channel], unit: str, why: str) -> dict[str, Quantity]:
    """Parameters of all channels; what the status does not allow to be quoted says why."""
    out = {}
    for name, channel in channels.items():
        for field in FIELDS:
            value = _known(getattr(channel, field))
            reason = "" if field in _QUOTED[channel.status] and finite(value) else channel.withheld or why
            if field == "K" and not reason:
                reason = _gain_unknown(unit)
            out[f"{name} {field}"] = Quantity(value, _per(unit, name) if field == "K" else "s", reason)
    return out


def _gain_unknown(unit: str) -> str:
    return "" if unit else "the JSON does not state the output's unit: write it with this version of canid"


def _per(unit: str, name: str) -> str:
    return f"{unit} per {_INPUT_UNITS.get(name, name)}" if unit else ""


def _effect(finding: Finding) -> Effect:
    parameters = {
        name: Quantity(_known(iv), finding.units.get(name, "")) for name, iv in finding.parameters.items()
    }
    return Effect(finding.effect, finding.where, finding.rivals, finding.surrogate, parameters)


def _level(row: Mapping[str, Any]) -> Level:
    t, level, low, high = (
        np.where(np.isfinite(x), x, NAN) for x in (row["t"], row["level"], row["low"], row["high"])
    )
    name, variation = f"{row['input']} {row['parameter']}", row["variation"].value
    return Level(name, t, level, low, high, row["p_value"], variation)


def _draws(drawn: Drawn | None) -> Draws | None:
    if drawn is None or len(drawn.K) < 2:
        return None
    return Draws(
        TASK_INPUTS["car_following"], *map(short_draws, drawn)
    )  # rounded as in the JSON: both give the same comparison


def _loop(loop: IdentifiedLoop) -> Loop | None:
    if loop.says:
        return None
    car = loop.car
    if car is None:
        return Loop(loop.speed, loop.headway, None, np.zeros((3, 3)))
    values = car.strength.value, car.lag.value, car.damping.value
    return Loop(loop.speed, loop.headway, values, car.covariance)


def _correlation(model: IdentifiedModel) -> Correlation | None:
    """Of gains, lags and dead times, and of their sums."""
    names, covariance = model.names, model.covariance
    at = [k for k, name in enumerate(names) if name in _MODEL_NAMES and covariance[k, k] > 0.0]
    rows, labels = list(np.eye(len(names))[at]), [_MODEL_NAMES[names[k]] for k in at]
    for name in TASK_INPUTS["car_following"]:
        parts = [f"{name} tau", f"{name} dead_time"]
        if all(part in labels for part in parts):
            rows.append(sum(rows[labels.index(part)] for part in parts))
            labels.append(f"{name} tau_plus_dead_time")
    if not rows:
        return None
    of_rows = np.array(rows) @ covariance @ np.array(rows).T
    sd = np.sqrt(np.maximum(np.diag(of_rows), 1e-300))
    return Correlation(tuple(labels), np.clip(of_rows / np.outer(sd, sd), -1.0, 1.0))


def _known(iv: Interval) -> Interval:
    """The same with NaN for what is not finite, as JSON has it."""
    return Interval(*(x if math.isfinite(x) else NAN for x in iv))
