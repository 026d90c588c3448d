"""A drive from the JSON of `canid identify` or `canid diagnose` (docs/json.md); logs are compared by the same object."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from canid.comparison.drive import (
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
from canid.types import NAN, TASK_INPUTS, Array, Identifiable, Interval

# which fields the status of a channel allows to be quoted; a status that is not known allows none
_QUOTED = {
    Identifiable.OK.value: FIELDS,
    Identifiable.SUM_ONLY.value: ("K", "tau_plus_dead_time"),
    Identifiable.GAIN_ONLY.value: ("K",),
}
# names of a diagnosis' model, and what they are called here
_MODEL_NAMES = {
    f"{field}{i}": f"{name} {field}"
    for i, name in enumerate(TASK_INPUTS["car_following"], 1)
    for field in ("K", "tau", "dead_time")
}
NOT_IDENTIFIABLE = "not identifiable"


def read(of: Mapping[str, Any], name: str = "") -> DriveEstimates:
    """Read one drive.

    Args:
        of: one JSON object.
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
        if "verdict" in of and "extended" in of:
            return _diagnosed(of, name or _text(of["log"]))
        if "whole" in of and "windows" in of:
            return _identified(of, name or _text(of["log"]))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        what = f"key {error}" if isinstance(error, KeyError) else str(error)
        raise ValueError(f"it is not as canid writes it ({what})") from error
    raise ValueError("it is the output of neither canid identify --json nor canid diagnose --json")


def _identified(of: Mapping[str, Any], name: str) -> DriveEstimates:
    whole = of["whole"] or {}
    summary = of.get("summary") or {}
    changes = tuple(_number(change["t"]["value"]) for change in whole.get("changes") or ())
    why = NOT_IDENTIFIABLE
    if changes:
        times = ", ".join(f"{t:.0f}" for t in changes)
        why = f"the gains changed during the drive, at {times} s: compare the parts between"
    elif not whole:
        why = "no model of the whole drive"
    unit = _text(of.get("unit") or "")
    quantities = _channels(whole.get("channels") or {}, unit, why)
    noise = _interval(summary.get("noise_sd"))
    if not finite(noise) and quantities:
        quantities["noise_sd"] = Quantity(noise, unit, "the drive is too short for an interval")
    elif quantities:
        quantities["noise_sd"] = Quantity(noise, unit, _gain_unknown(unit) or ("" if not changes else why))
    wanted = _interval(summary.get("wanted_headway"))
    if finite(wanted):
        quantities["wanted_headway"] = Quantity(wanted, "s", "" if not changes else why)
    fopdt = whole.get("estimator", "fopdt") == "fopdt"
    return DriveEstimates(
        name=name,
        method="identify",
        vehicle=_text(of["vehicle"]),
        output=_text(of.get("output") or ""),
        used=_number(of["driver_time"]),
        quantities=quantities,
        driven={role: _interval(x) for role, x in (summary.get("driven") or {}).items()},
        excitation={key: _number(x) for key, x in (summary.get("excitation") or {}).items()},
        draws=_draws(summary.get("draws")) if fopdt and not changes else None,
        loop=_loop(of.get("loop")),
        levels=tuple(_level(x) for x in whole.get("constancy") or ()),
        changes=changes,
        duration=_number(of.get("duration")),
    )


def _diagnosed(of: Mapping[str, Any], name: str) -> DriveEstimates:
    fit, unit = of["extended"], _text(of["unit"] or "")
    quantities = _channels(fit["channels"], unit, NOT_IDENTIFIABLE)
    if quantities:
        quantities["noise_sd"] = Quantity(
            Interval(_number(fit["noise_sd"])), unit, "a diagnosis gives no interval of it"
        )
    form = fit.get("form") or {}
    for parameter, value in (form.get("parameters") or {}).items():
        # the same symbol means another thing in another form
        key = f"{_text(form['name'])} {_text(parameter)}"
        quantities[key] = Quantity(_interval(value), _text(form["units"].get(parameter, "")))
    model = of.get("model") or {}
    return DriveEstimates(
        name=name,
        method="diagnose",
        vehicle=_text(of["vehicle"]),
        output=_text(of["output"]),
        used=_number(of["used_time"]),
        quantities=quantities,
        driven={
            role: _interval(x) for role, x in (model.get("driven") or {}).items() if role != "range_rate"
        },
        correlation=_correlation(model) if model else None,
        duration=_number(of.get("duration")),
        causes=Causes(
            _text(of["verdict"]),
            tuple(_effect(f) for f in of["findings"]),
            {
                _text(one["effect"]): (_text(one["parameter"]), _number(one["strength"]), _text(one["unit"]))
                for one in of.get("power") or ()
            },
            frozenset(_text(u["effects"][0]) for u in of.get("not_testable") or () if len(u["effects"]) == 1),
        ),
    )


def _channels(channels: Mapping[str, Any], unit: str, why: str) -> dict[str, Quantity]:
    """Parameters of all channels; what the status does not allow to be quoted says why."""
    out = {}
    for name, channel in channels.items():
        quoted = _QUOTED.get(channel["status"], ())
        for field in FIELDS:
            value = _interval(channel[field])
            reason = "" if field in quoted and finite(value) else why
            own = _per(unit, _text(name)) if field == "K" else "s"
            if field == "K" and not reason:
                reason = _gain_unknown(unit)
            out[f"{_text(name)} {field}"] = Quantity(value, own, reason)
    return out


def _gain_unknown(unit: str) -> str:
    return "" if unit else "the JSON does not state the output's unit: write it with this version of canid"


# unit of an input; of one that is not here the gain has the output's unit per unit of the input
_INPUT_UNITS = {"headway_error": "s", "range_rate": "m/s", "lateral_offset": "m"}


def _per(unit: str, name: str) -> str:
    return f"{unit} per {_INPUT_UNITS.get(name, name)}" if unit else ""


def _effect(of: Mapping[str, Any]) -> Effect:
    units = of.get("units") or {}
    return Effect(
        _text(of["effect"]),
        _text(of["where"]),
        tuple(_text(x) for x in of.get("rivals") or ()),
        bool(of.get("surrogate")),
        {
            _text(key): Quantity(_interval(x), _text(units.get(key, "")))
            for key, x in (of.get("parameters") or {}).items()
        },
    )


def _level(of: Mapping[str, Any]) -> Level:
    t, level, low, high = (_array(of[key]) for key in ("t", "level", "low", "high"))
    if not len(t) == len(level) == len(low) == len(high):
        raise ValueError("the columns of constancy differ in length")
    variation = _number(of["variation"]["value"])
    name = f"{_text(of['input'])} {_text(of['parameter'])}"
    return Level(name, t, level, low, high, _number(of["p_value"]), variation)


def _draws(of: Mapping[str, Any] | None) -> Draws | None:
    if not of:
        return None
    columns = [_array(of[key]) for key in ("K", "tau", "dead_time")]
    if any(x.ndim != 2 or x.shape != (len(columns[0]), 2) or not np.isfinite(x).all() for x in columns):
        raise ValueError("the draws are no table of two columns")
    return Draws(TASK_INPUTS["car_following"], *columns) if len(columns[0]) > 1 else None


def _loop(of: Mapping[str, Any] | None) -> Loop | None:
    if not of or of.get("says"):
        return None
    car = of.get("car")
    values, covariance = None, np.zeros((3, 3))
    if car is not None:
        values = tuple(_number(car[key]["value"]) for key in ("strength", "lag", "damping"))
        covariance = _array(car["covariance"])
        if covariance.shape != (3, 3) or not np.isfinite([*values, *covariance.ravel()]).all():
            raise ValueError("the car's covariance is no table of 3 by 3")
    return Loop(_number(of["speed"]), _number(of["headway"]), values, covariance)  # type: ignore[arg-type]


def _correlation(model: Mapping[str, Any]) -> Correlation | None:
    """Of gains, lags and dead times, and of their sums."""
    covariance = _array(model["covariance"])
    names = [_text(name) for name in model["names"]]
    if covariance.shape != (len(names), len(names)):
        raise ValueError("the covariance does not fit its names")
    at = [k for k, name in enumerate(names) if name in _MODEL_NAMES and covariance[k, k] > 0.0]
    rows, labels = list(np.eye(len(names))[at]), [_MODEL_NAMES[names[k]] for k in at]
    for name in TASK_INPUTS["car_following"]:
        parts = [f"{name} tau", f"{name} dead_time"]
        if all(part in labels for part in parts):
            rows.append(sum(rows[labels.index(part)] for part in parts))
            labels.append(f"{name} tau_plus_dead_time")
    if not rows:
        return None
    own = np.array(rows) @ covariance @ np.array(rows).T
    sd = np.sqrt(np.maximum(np.diag(own), 1e-300))
    return Correlation(tuple(labels), np.clip(own / np.outer(sd, sd), -1.0, 1.0))


def _interval(of: Mapping[str, Any] | None) -> Interval:
    return Interval() if of is None else Interval(*(_number(of[key]) for key in Interval._fields))


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
