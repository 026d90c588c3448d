"""A drive from the JSON of `canid identify` or `canid diagnose` (docs/json.md): read into their results."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from canid.analysis.comparison.drive import FIELDS, DriveEstimates
from canid.analysis.comparison.result_estimates import of_identified, of_report
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_summary import DriveSummary
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.systems.car_response import CarResponse
from canid.mathematics.systems.identified_loop import IdentifiedLoop
from canid.mathematics.systems.posterior_draws import Drawn
from canid.values.findings import BaselineForm, Finding, Fit, NotTestable, Report, Verdict, Visible, no_fit
from canid.values.identified_model import IdentifiedModel, NoiseLaw
from canid.values.types import NAN, Array, Channel, GainChange, Identifiable, Interval

# a status that is not known allows no parameter to be quoted
_STATUS = {status.value: status for status in Identifiable}


def read(data: Mapping[str, Any], name: str = "") -> DriveEstimates:
    """Read one drive.

    Args:
        data: one JSON object.
        name: of the drive; "": that of its log.

    Raises:
        ValueError: it is the output of neither verb.

    Example:
        >>> iv = {"value": 5.0, "low": 4.0, "high": 6.0}
        >>> channel = {"K": iv, "tau": iv, "dead_time": iv, "tau_plus_dead_time": iv, "status": "gain_only"}
        >>> drive = read({"log": "a.blf", "vehicle": "car", "windows": [], "unit": "%", "driver_time": 300.0,
        ...     "whole": {"channels": {"range_rate": channel}}})
        >>> drive.quantities["range_rate K"].value.high, drive.quantities["range_rate tau"].why
        (6.0, 'not identifiable')
    """
    try:
        if "verdict" in data and "extended" in data:
            return _diagnosed(data, name or _text(data["log"]))
        if "whole" in data and "windows" in data:
            return _identified(data, name or _text(data["log"]))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        what = f"key {error}" if isinstance(error, KeyError) else str(error)
        raise ValueError(f"it is not as canid writes it ({what})") from error
    raise ValueError("it is the output of neither canid identify --json nor canid diagnose --json")


def _identified(data: Mapping[str, Any], name: str) -> DriveEstimates:
    whole, summary = data["whole"] or {}, data.get("summary") or {}
    estimator = _text(whole.get("estimator", "fopdt"))
    details = {
        "changes": [GainChange(_interval(change["t"]), {}, {}, NAN) for change in whole.get("changes") or ()],
        "constancy": [_level(row) for row in whole.get("constancy") or ()],
    }
    result = Identified(
        duration=_number(data.get("duration")),
        driver_time=_number(data["driver_time"]),
        windows=(),
        whole={
            estimator: WholeDrive(_channels(whole.get("channels") or {}), details=details) if whole else None
        },
        orders=(),
        loop=_loop(data.get("loop")),
        drive_summary=DriveSummary(
            output=_text(data.get("output") or ""),
            driven=_intervals(summary.get("driven")),
            excitation={key: _number(x) for key, x in (summary.get("excitation") or {}).items()},
            noise_sd=_interval(summary.get("noise_sd")),
            wanted_headway=_interval(summary.get("wanted_headway")),
            draws=_draws(summary.get("draws")),
        ),
    )
    return of_identified(result, name, _text(data["vehicle"]), _text(data.get("unit") or ""))


def _diagnosed(data: Mapping[str, Any], name: str) -> DriveEstimates:
    fit, form, model = data["extended"], data["extended"].get("form"), data.get("model")
    nothing = no_fit(0)
    report = Report(
        verdict=Verdict(data["verdict"]),
        says="",
        output=_text(data["output"]),
        t=np.zeros(0),
        measured=np.zeros(0),
        used=np.zeros(0, dtype=np.bool_),
        baseline=nothing,
        extended=Fit(
            _channels(fit["channels"]),
            NAN,
            nothing.simulated,
            _number(fit["noise_sd"]),
            _form(form) if form else None,
        ),
        findings=tuple(map(_finding, data["findings"])),
        unexplained=Interval(),
        gain=Interval(),
        not_testable=tuple(
            NotTestable(tuple(map(_text, row["effects"])), "") for row in data.get("not_testable") or ()
        ),
        candidates_tried=0,
        tried=(),
        checks=(),
        masked=(),
        blocks=(),
        worst=(),
        maps=(),
        spectra=None,
        closed_loop=(),
        shifts={},
        advice=(),
        steps=(),
        model=_model(model) if model else None,
        visible=tuple(map(_visible, data.get("power") or ())),
    )
    drive = of_report(report, name, _text(data["vehicle"]), _text(data["unit"] or ""))
    return drive._replace(used=_number(data["used_time"]), duration=_number(data.get("duration")))


def _channels(channels: Mapping[str, Any]) -> dict[str, Channel]:
    out = {}
    for name, channel in channels.items():
        K, tau, dead_time, total = (_interval(channel[field]) for field in FIELDS)
        status = _STATUS.get(channel["status"], Identifiable.NOT)
        withheld = _text(channel.get("withheld", ""))
        out[_text(name)] = Channel(K, tau, dead_time, total, status, withheld=withheld)
    return out


def _form(form: Mapping[str, Any]) -> BaselineForm:
    return BaselineForm(
        _text(form["name"]), _intervals(form.get("parameters")), _texts(form.get("units")), ""
    )


def _finding(finding: Mapping[str, Any]) -> Finding:
    return Finding(
        _text(finding["effect"]),
        _text(finding["where"]),
        tuple(map(_text, finding.get("rivals") or ())),
        bool(finding.get("surrogate")),
        _intervals(finding.get("parameters")),
        _texts(finding.get("units")),
        Interval(),
        "",
        NAN,
        NAN,
    )


def _visible(entry: Mapping[str, Any]) -> Visible:
    return Visible(
        _text(entry["effect"]),
        _text(entry["parameter"]),
        _number(entry["strength"]),
        _text(entry["unit"]),
        NAN,
    )


def _model(model: Mapping[str, Any]) -> IdentifiedModel:
    """What a comparison needs of a model."""
    names, covariance = tuple(map(_text, model["names"])), _array(model["covariance"])
    if covariance.shape != (len(names), len(names)):
        raise ValueError("the covariance does not fit its names")
    driven = _intervals(model.get("driven"))
    return IdentifiedModel("", "", {}, covariance, names, {}, NoiseLaw(NAN, (), NAN), None, driven)


def _level(row: Mapping[str, Any]) -> dict[str, Any]:
    columns = {key: _array(row[key]) for key in ("t", "level", "low", "high")}
    if len({len(column) for column in columns.values()}) > 1:
        raise ValueError("the columns of constancy differ in length")
    names = {key: _text(row[key]) for key in ("input", "parameter")}
    return {**names, **columns, "p_value": _number(row["p_value"]), "variation": _interval(row["variation"])}


def _draws(draws: Mapping[str, Any] | None) -> Drawn | None:
    if not draws:
        return None
    columns = [_array(draws[key]) for key in Drawn._fields]
    if any(x.ndim != 2 or x.shape != (len(columns[0]), 2) or not np.isfinite(x).all() for x in columns):
        raise ValueError("the draws are no table of two columns")
    return Drawn(*columns)


def _loop(loop: Mapping[str, Any] | None) -> IdentifiedLoop:
    if not loop or loop.get("says"):
        return IdentifiedLoop()
    car, response = loop.get("car"), None
    if car is not None:
        strength, lag, damping = (
            Interval(_number(car[key]["value"])) for key in ("strength", "lag", "damping")
        )
        covariance = _array(car["covariance"])
        numbers = [strength.value, lag.value, damping.value, *covariance.ravel()]
        if covariance.shape != (3, 3) or not np.isfinite(numbers).all():
            raise ValueError("the car's covariance is no table of 3 by 3")
        response = CarResponse(strength, lag, damping, covariance, NAN)
    return IdentifiedLoop("", _number(loop["speed"]), _number(loop["headway"]), car=response)


def _intervals(values: Mapping[str, Any] | None) -> dict[str, Interval]:
    return {_text(name): _interval(value) for name, value in (values or {}).items()}


def _texts(values: Mapping[str, Any] | None) -> dict[str, str]:
    return {_text(name): _text(value) for name, value in (values or {}).items()}


def _interval(interval: Mapping[str, Any] | None) -> Interval:
    return Interval() if interval is None else Interval(*(_number(interval[key]) for key in Interval._fields))


def _number(x: Any) -> float:
    """A number; null and what is no finite number is NaN."""
    if x is None:
        return NAN
    value = float(x)
    return value if math.isfinite(value) else NAN


def _array(x: Any) -> Array:
    return np.array(x, dtype=np.float64)


def _text(x: Any) -> str:
    if not isinstance(x, str):
        raise TypeError(f"{x!r} is not a text")
    return x
