"""A diagnosis as the JSON object that docs/json.md describes."""

from __future__ import annotations

from typing import Any

from canid import identified_model
from canid.findings import (
    Check,
    ClosedLoopError,
    DriveShare,
    Finding,
    Fit,
    NullGain,
    OperatingMap,
    Report,
    Rival,
    Spectra,
    Trajectory,
    Tried,
    Visible,
    Window,
    nrmse,
)
from canid.views import closed_loop, json_values, search_bounds
from canid.views.closed_loop import rms_error
from canid.views.diagnosis_parts import duration, remarks, step, used_time
from canid.views.numbers import role_unit


def to_json(report: Report, log: str, vehicle: str) -> dict[str, Any]:
    """The JSON object of a diagnosis; null where nothing is known.

    Args:
        report: the diagnosis.
        log: name of the log.
        vehicle: name of the vehicle.
    """
    return {
        "log": log,
        "vehicle": vehicle,
        "duration": json_values.number(duration(report)),
        "used_time": json_values.number(used_time(report)),
        "time": None if report.time is None else json_values.plain(report.time),
        "signals": [json_values.signal_finding(one) for one in report.signals],
        "output": report.output,
        "unit": role_unit(report.output),
        "verdict": report.verdict.value,
        "says": " ".join([search_bounds.without_intervals(report.says, report), *remarks(report)]),
        "remarks": remarks(report),
        "baseline": _fit(report.baseline, 0.5 * step(report)),
        "extended": _fit(report.extended, 0.5 * step(report)),
        "findings": [_finding(f) for f in report.findings],
        "unexplained": json_values.interval(report.unexplained),
        "gain": json_values.interval(report.gain),
        "null_gain": _null_gain(report.null_gain),
        "log_score_gain": json_values.interval(report.log_score_gain),
        "not_testable": [{"effects": list(u.effects), "why": u.why} for u in report.not_testable],
        "power": [_visible(one) for one in report.visible],
        "advice": list(report.advice),
        "candidates_tried": int(report.candidates_tried),
        "tried": [_tried(row) for row in report.tried],
        "checks": [_check(c) for c in report.checks],
        "masked": [{"effect": m.effect, **_time_range(m.start, m.stop)} for m in report.masked],
        "blocks": [block._asdict() for block in report.blocks],
        "worst": [_window(w) for w in report.worst],
        "maps": [_map(m) for m in report.maps],
        "spectra": None if report.spectra is None else _spectra(report.spectra),
        "closed_loop": [_trajectory(of) for of in report.closed_loop],
        "rivals": [_rival(one) for one in report.rivals],
        "recommended": report.recommended or None,
        "shifts": {
            key: {"before": json_values.interval(before), "after": json_values.interval(after)}
            for key, (before, after) in report.shifts.items()
        },
        "model": None if report.model is None else identified_model.to_json(report.model),
        "drives": [_drive(one) for one in report.drives],
        "differ": list(report.differ),
        "steps": list(report.steps),
        "provenance": {
            name: dict(of) if name in ("versions", "dbc_sha256") else of
            for name, of in report.provenance._asdict().items()
        },
    }


def _drive(one: DriveShare) -> dict[str, Any]:
    return {
        "log": one.name,
        "used_time": json_values.number(one.used),
        "gains": {effect: json_values.interval(iv) for effect, iv in one.gains.items()},
        "channels": json_values.channels(one.channels),
    }


def _fit(fit: Fit, half_step: float) -> dict[str, Any]:
    return {
        "at_bound": search_bounds.as_json(search_bounds.of_fit(fit, half_step)),
        "channels": json_values.channels(fit.channels),
        "fit_percent": json_values.number(fit.fit_percent),
        "noise_sd": json_values.number(fit.noise_sd),
        "form": None
        if fit.form is None
        else {
            "name": fit.form.name,
            "parameters": {name: json_values.interval(iv) for name, iv in fit.form.parameters.items()},
            "units": dict(fit.form.units),
            "says": fit.form.says,
        },
    }


def _finding(f: Finding) -> dict[str, Any]:
    return {
        "effect": f.effect,
        "where": f.where,
        "rivals": list(f.rivals),
        "surrogate": bool(f.surrogate),
        "parameters": {name: json_values.interval(iv) for name, iv in f.parameters.items()},
        "units": dict(f.units),
        "at_bound": search_bounds.as_json(search_bounds.of_finding(f)),
        "gain": json_values.interval(f.gain),
        "null_gain": _null_gain(f.null_gain),
        "log_score_gain": json_values.interval(f.log_score_gain),
        "says": f.says,
        "evidence": json_values.number(f.evidence),
        "needed": json_values.number(f.needed),
        "episodes": [_time_range(*episode) for episode in f.episodes],
    }


def _null_gain(null: NullGain) -> dict[str, Any]:
    numbers = {"median": json_values.number(null.median), "high": json_values.number(null.high)}
    return numbers | {"replicates": int(null.replicates)}


def _visible(of: Visible) -> dict[str, Any]:
    return {
        "effect": of.effect,
        "parameter": of.parameter,
        "strength": json_values.number(of.strength),
        "unit": of.unit,
        "bends_K2": json_values.number(of.bends),
    }


def _check(c: Check) -> dict[str, Any]:
    return {
        "name": c.name,
        "passed": None if c.passed is None else bool(c.passed),
        "value": json_values.number(c.value),
        "limit": json_values.number(c.limit),
        "unit": c.unit,
        "gate": bool(c.gate),
        "says": c.says,
    }


def _window(w: Window) -> dict[str, Any]:
    residual = {"before": json_values.number(w.before), "after": json_values.number(w.after)}
    return _time_range(w.start, w.stop) | residual


def _time_range(start: float, stop: float) -> dict[str, float | None]:
    return {"start": json_values.number(start), "stop": json_values.number(stop)}


def _tried(row: Tried) -> dict[str, Any]:
    numbers = {name: json_values.number(getattr(row, name)) for name in ("evidence", "needed", "expected")}
    return row._asdict() | numbers | {"step": int(row.step)}


def _map(of: OperatingMap) -> dict[str, Any]:
    columns = ("x_edges", "y_edges", "before", "after", "seconds")
    return {"x": of.x, "y": of.y, **{name: json_values.array(getattr(of, name)) for name in columns}}


def _spectra(of: Spectra) -> dict[str, Any]:
    return {
        "frequency": json_values.array(of.frequency),
        "before": json_values.array(of.before),
        "after": json_values.array(of.after),
        "coherence_before": {name: json_values.array(row) for name, row in of.coherence_before.items()},
        "coherence_after": {name: json_values.array(row) for name, row in of.coherence_after.items()},
        "level": json_values.number(of.level),
    }


def _trajectory(of: Trajectory) -> dict[str, Any]:
    return {
        "role": of.role,
        "unit": role_unit(of.role),
        "before": json_values.number(rms_error(of, of.before)),
        "after": json_values.number(rms_error(of, of.after)),
        "gain": json_values.interval(of.gain),
        "worse": closed_loop.worse(of),
        "nrmse_before": json_values.number(nrmse(of.before, of.measured)),
        "nrmse_after": json_values.number(nrmse(of.after, of.measured)),
    }


def _rival(of: Rival) -> dict[str, Any]:
    return {
        "model": of.model,
        "source": of.source,
        "status": of.status,
        "says": of.says,
        "parameters": {name: json_values.interval(iv) for name, iv in of.parameters.items()},
        "units": dict(of.units),
        "at_bound": search_bounds.as_json(search_bounds.of_rival(of)),
        **_nrmse(of.nrmse),
        "folds": [_nrmse(one) for one in of.folds],
    }


def _nrmse(of: ClosedLoopError) -> dict[str, float | None]:
    return {"nrmse_gap": json_values.number(of.gap), "nrmse_speed": json_values.number(of.speed)}
