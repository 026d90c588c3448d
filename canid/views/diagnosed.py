"""A diagnosis as text for the terminal and as JSON."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from canid.findings import Finding, Fit, OperatingMap, Report, Spectra, Trajectory, Tried, Verdict, masked_for
from canid.types import Array, Interval
from canid.views import as_json
from canid.views.measures import measure, number, percent, role_unit, shifted, stretch
from canid.views.table import columns
from canid.views.words import SYMBOLS

VERDICT_WORDS = {
    Verdict.ADEQUATE: "ADEQUATE",
    Verdict.NAMED: "NAMED",
    Verdict.ONE_OF: "ONE OF",
    Verdict.UNEXPLAINED: "UNEXPLAINED",
    Verdict.NOT_ENOUGH_DATA: "NOT ENOUGH DATA",
}
# lines of one kind that a terminal shows; the page and the JSON have all
WORST_SHOWN = 3
UNDECIDED_SHOWN = 6


# --- text -------------------------------------------------------------------------------------------------


def text(report: Report, log: str, vehicle: str) -> list[str]:
    """What `canid diagnose` prints: the verdict first.

    Args:
        report: the diagnosis.
        log: name of the log.
        vehicle: name of the vehicle.
    """
    lines = [f"{VERDICT_WORDS[report.verdict]}: {sentence(report)}", *_about(report, log, vehicle)]
    for finding in report.findings:
        lines += ["", *_finding(finding)]
    blocks = [f"{block.where} ({block.state.replace('_', ' ')}): {block.says}" for block in report.blocks]
    lines += _headed("block by block", blocks)
    masks = [f"{effect}: {number(seconds, 's')}" for effect, seconds in masked_for(report.masked).items()]
    lines += _headed("not the driver's own answer, masked before anything was fitted", masks)
    if report.unexplained.value == report.unexplained.value:
        lines += ["", f"share of the residual that no cause explains: {percent(report.unexplained)}"]
    lines += _headed("not to be decided on this drive", _undecided(report))
    lines += _headed("the drive that would decide", advice(report))
    lines += _headed("the driver, before and after" if report.findings else "the driver", _shifts(report))
    failed = [f"✗ {'gate: ' * c.gate}{c.name}: {c.says} ({number(c.value, c.unit)}, limit {number(c.limit, c.unit)})"
              for c in report.checks if c.passed is False]  # fmt: skip
    if report.checks:
        made = [c for c in report.checks if c.passed is not None]
        lines += _headed(f"checks: {len(made) - len(failed)} of {len(made)} passed", failed, always=True)
    lines += _headed("where it is worst", _worst(report))
    lines += _headed("in closed loop, behind the lead of the log", [_loop(of) for of in report.closed_loop])
    return lines


def _loop(of: Trajectory) -> str:
    unit = role_unit(of.role)
    says = f"{of.role}: error {number(off(of, of.before), unit)} rms"
    if not told_apart(of):
        return says
    return f"{says}, after {number(off(of, of.after), unit)}; gain {percent(of.gain)} held out"


def off(of: Trajectory, simulated: Array) -> float:
    """Root mean square of a trajectory's error, where it was simulated."""
    here = np.isfinite(simulated) & np.isfinite(of.measured)
    return float(np.sqrt(np.mean((simulated - of.measured)[here] ** 2))) if here.any() else math.nan


def told_apart(of: Trajectory) -> bool:
    """Has what was found changed this trajectory?"""
    return math.isfinite(of.gain.value)


def _about(report: Report, log: str, vehicle: str) -> list[str]:
    lines = [
        f"{log}: {vehicle}, {number(duration(report), 's')}, {number(used_time(report), 's')} of them used"
    ]
    before, after = report.baseline.fit_percent, report.extended.fit_percent
    if before == before:
        fit = f"simulation fits {number(before, '%')}"
        fit += f", with what was found {number(after, '%')}" if report.findings else ""
        lines.append(f"{fit}; {report.candidates_tried} causes tried")
    return lines


def _finding(finding: Finding) -> list[str]:
    title = f"{finding.effect} ({finding.where}{', surrogate: it helps, but is not the cause' * finding.surrogate})"
    parameters = [
        f"{name} {measure(iv, finding.units.get(name, ''))}" for name, iv in finding.parameters.items()
    ]
    lines = [
        title,
        f"  {finding.says}",
        f"  evidence {number(finding.evidence)} (needed {number(finding.needed)}), gain {percent(finding.gain)} held out",
    ]
    lines += [f"  {', '.join(parameters)}"] if parameters else []
    lines += [f"  at {', '.join(stretch(*e) for e in finding.episodes)}"] if finding.episodes else []
    return [*lines, f"  rivals: {', '.join(finding.rivals) or 'none'}"]


def _undecided(report: Report) -> list[str]:
    """One line per reason: causes that are invisible for the same one share it."""
    by_reason: dict[str, list[str]] = {}
    for of in report.not_testable:
        by_reason.setdefault(of.why, []).append(" or ".join(of.effects))
    lines = [f"{', '.join(names)}: {why}" for why, names in by_reason.items()]
    more = len(lines) - UNDECIDED_SHOWN
    return [*lines[:UNDECIDED_SHOWN], *([f"and {more} more, in --json and --report"] if more > 0 else [])]


def _shifts(report: Report) -> list[str]:
    rows = []
    for key, (before, after) in told(report).items():
        name, unit = shifted(key, report.output)
        both = (before, after) if report.findings else (before,)
        rows.append((f"{name} ({unit})" if unit else name, *map(measure, both)))
    return columns([""] * len(rows[0]), rows)[1:] if rows else []


def _worst(report: Report) -> list[str]:
    unit = role_unit(report.output)
    return [
        f"{stretch(w.start, w.stop)}: residual {number(w.before, unit)} rms"
        + (f", after {number(w.after, unit)}" if report.findings else "")
        for w in report.worst[:WORST_SHOWN]
    ]


def _headed(title: str, lines: list[str] | tuple[str, ...], *, always: bool = False) -> list[str]:
    return ["", title, *(f"  {line}" for line in lines)] if lines or always else []


def sentence(report: Report) -> str:
    """Return the verdict line without the word in capitals that it may begin with.

    Example:
        >>> from types import SimpleNamespace
        >>> sentence(SimpleNamespace(says="ONE OF: {a, b}."))
        '{a, b}.'
    """
    return re.sub(r"^[A-Z][A-Z ]+: ", "", report.says)


def told(report: Report) -> dict[str, tuple[Interval, Interval]]:
    """Return the parameters, before and after, of which at least one model can tell something."""
    shifts = report.shifts or {
        f"{name} {what}": (getattr(channel, what), getattr(report.extended.channels.get(name, channel), what))
        for name, channel in report.baseline.channels.items()
        for what in SYMBOLS
    }
    return {key: both for key, both in shifts.items() if any(math.isfinite(iv.value) for iv in both)}


def advice(report: Report) -> list[str]:
    """Return what to drive, without what the reasons of `not_testable` say already."""
    said = " ".join(of.why for of in report.not_testable)
    return [line for line in report.advice if line.partition(": ")[2] not in said or ": " not in line]


def duration(report: Report) -> float:
    """Length of the drive, s."""
    return float(report.t[-1] - report.t[0]) + step(report) if len(report.t) else 0.0


def used_time(report: Report) -> float:
    """How much of it the fit rests on, s."""
    return float(report.used.sum()) * step(report)


def step(report: Report) -> float:
    """Step of the grid, s; 0 for less than two samples.

    Example:
        >>> import numpy as np
        >>> from types import SimpleNamespace
        >>> step(SimpleNamespace(t=np.array([5.0, 5.1, 5.2])))
        0.1
    """
    return round(float(report.t[-1] - report.t[0]) / (len(report.t) - 1), 9) if len(report.t) > 1 else 0.0


# --- JSON -------------------------------------------------------------------------------------------------


def to_json(report: Report, log: str, vehicle: str) -> dict[str, Any]:
    """Make the object that docs/json.md describes; null where nothing is known.

    Args:
        report: the diagnosis.
        log: name of the log.
        vehicle: name of the vehicle.
    """
    return {
        "log": log,
        "vehicle": vehicle,
        "duration": as_json.number(duration(report)),
        "used_time": as_json.number(used_time(report)),
        "output": report.output,
        "unit": role_unit(report.output),
        "verdict": report.verdict.value,
        "says": report.says,
        "baseline": _fit(report.baseline),
        "extended": _fit(report.extended),
        "findings": [
            {
                "effect": f.effect,
                "where": f.where,
                "rivals": list(f.rivals),
                "surrogate": bool(f.surrogate),
                "parameters": {name: as_json.interval(iv) for name, iv in f.parameters.items()},
                "units": dict(f.units),
                "gain": as_json.interval(f.gain),
                "says": f.says,
                "evidence": as_json.number(f.evidence),
                "needed": as_json.number(f.needed),
                "episodes": [_stretch(*episode) for episode in f.episodes],
            }
            for f in report.findings
        ],
        "unexplained": as_json.interval(report.unexplained),
        "gain": as_json.interval(report.gain),
        "not_testable": [{"effects": list(u.effects), "why": u.why} for u in report.not_testable],
        "advice": list(report.advice),
        "candidates_tried": int(report.candidates_tried),
        "tried": [_tried(row) for row in report.tried],
        "checks": [
            {
                "name": c.name,
                "passed": None if c.passed is None else bool(c.passed),
                "value": as_json.number(c.value),
                "limit": as_json.number(c.limit),
                "unit": c.unit,
                "gate": bool(c.gate),
                "says": c.says,
            }
            for c in report.checks
        ],
        "masked": [{"effect": m.effect, **_stretch(m.start, m.stop)} for m in report.masked],
        "blocks": [block._asdict() for block in report.blocks],
        "worst": [
            {
                **_stretch(w.start, w.stop),
                "before": as_json.number(w.before),
                "after": as_json.number(w.after),
            }
            for w in report.worst
        ],
        "maps": [_map(m) for m in report.maps],
        "spectra": None if report.spectra is None else _spectra(report.spectra),
        "closed_loop": [_trajectory(of) for of in report.closed_loop],
        "shifts": {
            key: {"before": as_json.interval(before), "after": as_json.interval(after)}
            for key, (before, after) in report.shifts.items()
        },
        "steps": list(report.steps),
        "provenance": {
            name: dict(of) if name in ("versions", "dbc_sha256") else of
            for name, of in report.provenance._asdict().items()
        },
    }


def _fit(fit: Fit) -> dict[str, Any]:
    return {
        "channels": as_json.channels(fit.channels),
        "fit_percent": as_json.number(fit.fit_percent),
        "noise_sd": as_json.number(fit.noise_sd),
    }


def _stretch(start: float, stop: float) -> dict[str, float | None]:
    return {"start": as_json.number(start), "stop": as_json.number(stop)}


def _tried(row: Tried) -> dict[str, Any]:
    numbers = {name: as_json.number(getattr(row, name)) for name in ("evidence", "needed", "expected")}
    return row._asdict() | numbers | {"step": int(row.step)}


def _map(of: OperatingMap) -> dict[str, Any]:
    columns = ("x_edges", "y_edges", "before", "after", "seconds")
    return {"x": of.x, "y": of.y, **{name: numbers(getattr(of, name)) for name in columns}}


def _spectra(of: Spectra) -> dict[str, Any]:
    return {
        "frequency": numbers(of.frequency),
        "before": numbers(of.before),
        "after": numbers(of.after),
        "coherence_before": {name: numbers(row) for name, row in of.coherence_before.items()},
        "coherence_after": {name: numbers(row) for name, row in of.coherence_after.items()},
        "level": as_json.number(of.level),
    }


def _trajectory(of: Trajectory) -> dict[str, Any]:
    return {
        "role": of.role,
        "unit": role_unit(of.role),
        "before": as_json.number(off(of, of.before)),
        "after": as_json.number(off(of, of.after)),
        "gain": as_json.interval(of.gain),
    }


def numbers(array: Array) -> list[Any]:
    """Write an array of any shape as lists, null where it is not finite.

    Example:
        >>> import numpy as np
        >>> numbers(np.array([[1.0, np.nan]]))
        [[1.0, None]]
    """
    return [numbers(row) if getattr(row, "ndim", 0) else as_json.number(float(row)) for row in array]
