"""A diagnosis as text for the terminal, and the figures of it that the text, the JSON and the page share."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np

from canid.diagnosis.rivals.recommendation import CANID
from canid.findings import ClosedLoopError, Finding, NullGain, Report, Trajectory, extends, masked_for, nrmse
from canid.identification import identifiability
from canid.identified_model import equation
from canid.types import Array, Interval
from canid.views import signal_text
from canid.views.names import SYMBOLS, parameter, readable
from canid.views.numbers import interval, number, percent, role_unit, time_range
from canid.views.table import columns

# lines of one kind that a terminal shows; the page and the JSON have all
WORST_SHOWN = 3
UNDECIDED_SHOWN = 6
VISIBLE_SHOWN = 6


def text(report: Report, log: str, vehicle: str) -> list[str]:
    """What `canid diagnose` prints: the verdict first.

    Args:
        report: the diagnosis.
        log: name of the log.
        vehicle: name of the vehicle.
    """
    verdict = readable(report.verdict.value).upper()
    lines = [f"{verdict}: {sentence(report)}", *_about(report, log, vehicle)]
    for finding in report.findings:
        lines += ["", *_finding(finding)]
    blocks = [f"{block.where} ({readable(block.state)}): {block.says}" for block in report.blocks]
    lines += _headed("blocks of the loop", blocks)
    masks = [f"{effect}: {number(seconds, 's')}" for effect, seconds in masked_for(report.masked).items()]
    lines += _headed("masked before the fit: not the driver's response", masks)
    if math.isfinite(report.unexplained.value):
        lines += ["", f"share of the residual that no cause explains: {percent(report.unexplained)}"]
    lines += _headed("not testable on this drive", _undecided(report))
    lines += _headed("would have shown, nine times out of ten", _visible(report))
    lines += _headed("a drive that would decide", advice(report))
    title = "driver parameters: baseline, extended model" if extends(report) else "driver parameters"
    lines += _headed(title, _parameters(report))
    lines += _headed("drive by drive, each held against a fit to the others", _drives(report))
    if report.model is not None:
        lines += _headed("final model; L(τ, θ): lag τ, dead time θ", [equation(report.model)])
    lines += _checks(report)
    lines += _headed("worst windows", _worst(report))
    lines += _headed(
        "closed loop, with the lead vehicle of the log", [_closed_loop(of) for of in report.closed_loop]
    )
    lines += _headed("published car-following models in closed loop, on held-out data", _rivals(report))
    return lines


def _about(report: Report, log: str, vehicle: str) -> list[str]:
    lines = [
        f"{log}: {vehicle}, {number(duration(report), 's')}, {number(used_time(report), 's')} of them used"
    ]
    lines += [] if report.time is None else [f"time: {signal_text.time(report.time)}"]
    lines += signal_text.findings(report.signals)
    before, after = report.baseline.fit_percent, report.extended.fit_percent
    if before == before:
        fit = f"fit of the simulation {number(before, '%')}"
        fit += f", of the extended model {number(after, '%')}" if extends(report) else ""
        lines.append(f"{fit}; {report.candidates_tried} causes tried")
    return [*lines, *form(report)]


def form(report: Report) -> list[str]:
    """Which gap the extended model wants at a speed, with its parameters; [] where nothing was fitted."""
    of = report.extended.form
    if of is None:
        return []
    values = [f"{name} {interval(iv, of.units[name])}" for name, iv in of.parameters.items()]
    return [f"baseline: {of.says}{': ' if values else ''}{', '.join(values)}"]


def _finding(finding: Finding) -> list[str]:
    helps = "it helps, but is not the cause" if finding.gain.value > 0 else "not the cause"
    title = f"{finding.effect} ({finding.where}{f', surrogate: {helps}' * finding.surrogate})"
    evidence = f"evidence {number(finding.evidence)} (needed {number(finding.needed)})"
    lines = [
        title,
        f"  {finding.says}",
        f"  {evidence}, gain {gain(finding)} on held-out data",
    ]
    values = [
        f"{name} {interval(iv, finding.units.get(name, ''))}" for name, iv in finding.parameters.items()
    ]
    lines += [f"  {', '.join(values)}"] if values else []
    lines += [f"  at {', '.join(time_range(*e) for e in finding.episodes)}"] if finding.episodes else []
    return [*lines, f"  rivals: {', '.join(finding.rivals) or 'none'}"]


def _undecided(report: Report) -> list[str]:
    """One line per reason; causes with the same reason share it."""
    by_reason: dict[str, list[str]] = {}
    for of in report.not_testable:
        by_reason.setdefault(of.why, []).append(" or ".join(of.effects))
    lines = [f"{', '.join(names)}: {why}" for why, names in by_reason.items()]
    more = len(lines) - UNDECIDED_SHOWN
    return [*lines[:UNDECIDED_SHOWN], *([f"and {more} more, in --json and --report"] if more > 0 else [])]


def _visible(report: Report) -> list[str]:
    """What the drive could have shown, and what else could bend K of range rate; those that bend it most first."""
    lines = []
    for of in report.visible:
        unit, bends = "" if of.unit == "1" else of.unit, f"{100 * abs(of.bends):.2g} %"
        if math.isfinite(of.strength):
            seen = f"{of.effect} from {of.parameter} {of.strength:.2g}{f' {unit}' if unit else ''} on"
            then = f"; a weaker one bends K of range rate by up to {bends}"
        else:
            seen = f"{of.effect}: at no {of.parameter} up to eight times the typical one"
            then = f", which would bend K of range rate by {bends}"
        lines.append(f"{seen}{then if math.isfinite(of.bends) else ''}")
    more = len(lines) - VISIBLE_SHOWN
    return [*lines[:VISIBLE_SHOWN], *([f"and {more} more, in --json"] if more > 0 else [])]


def _parameters(report: Report) -> list[str]:
    rows = []
    for key, (before, after) in known_parameters(report).items():
        name, unit = parameter(key, report.output)
        shown = (before, after) if extends(report) else (before,)
        rows.append((f"{name} ({unit})" if unit else name, *map(interval, shown)))
    return columns([""] * len(rows[0]), rows)[1:] if rows else []


def _drives(report: Report) -> list[str]:
    """What each of several drives says of the findings, and of the driver."""
    lines = []
    for one in report.drives:
        gains = [f"{effect} {interval(iv, 'nats/min')}" for effect, iv in one.gains.items()]
        own = [
            f"K of {readable(name)} {interval(channel.K)}, τ+θ {interval(channel.tau_plus_dead_time, 's')}"
            for name, channel in one.channels.items()
        ]
        said = [*own, *([f"gain of {', '.join(gains)}"] if gains else [])]
        lines.append(f"{one.name} ({number(one.used, 's')}): {'; '.join(said) or 'too short'}")
    return [*lines, *(says[:1].upper() + says[1:] + "." for says in report.differ)]


def _checks(report: Report) -> list[str]:
    made = [c for c in report.checks if c.passed is not None]
    failed = [c for c in made if not c.passed]
    lines = [
        f"✗ {'adequacy, ' * c.gate}{c.name}: {c.says} ({number(c.value, c.unit)}, limit {number(c.limit, c.unit)})"
        for c in failed
    ]
    title = f"checks: {len(made) - len(failed)} of {len(made)} passed"
    return _headed(title, lines, always=True) if report.checks else []


def _worst(report: Report) -> list[str]:
    unit = role_unit(report.output)
    return [
        f"{time_range(w.start, w.stop)}: residual {number(w.before, unit)} rms"
        + (f", extended model {number(w.after, unit)}" if extends(report) else "")
        for w in report.worst[:WORST_SHOWN]
    ]


def _closed_loop(of: Trajectory) -> str:
    unit = role_unit(of.role)
    line = f"{readable(of.role)}: error {number(rms_error(of, of.before), unit)} rms"
    if not has_extended(of):
        return line
    return f"{line}, extended model {number(rms_error(of, of.after), unit)}; gain {percent(of.gain)} on held-out data"


def _rivals(report: Report) -> list[str]:
    models = closed_loop_models(report)
    missing = dict.fromkeys(one.says for one in report.rivals if one.says)
    if not models or not report.rivals:
        return list(missing)
    rows = [
        (one.name, number(100 * one.error.gap, "%"), number(100 * one.error.speed, "%")) for one in models
    ]
    table = columns(["model", "NRMSE of the gap", "of the speed"], rows)
    return [*table, *([recommendation(report)] if report.recommended else []), *missing]


def _headed(title: str, lines: list[str] | tuple[str, ...], *, always: bool = False) -> list[str]:
    return ["", title, *(f"  {line}" for line in lines)] if lines or always else []


# --- shared with the JSON and the page ----------------------------------------------------------------------


def sentence(report: Report) -> str:
    """The verdict's sentence without the word in capitals that it may begin with.

    Example:
        >>> from types import SimpleNamespace
        >>> sentence(SimpleNamespace(says="ONE OF: {a, b}."))
        '{a, b}.'
    """
    return re.sub(r"^[A-Z][A-Z ]+: ", "", report.says)


def gain(of: Finding | Report) -> str:
    """What a finding, or all of the driver's together, gain on held-out data: of the simulation and of the log score.

    Example:
        >>> from canid.findings import NullGain
        >>> from types import SimpleNamespace
        >>> found = SimpleNamespace(gain=Interval(0.3, 0.2, 0.4), log_score_gain=Interval(1.2, 0.5, 1.9))
        >>> found.null_gain = NullGain(0.1, 0.25, 39)
        >>> gain(found)
        '30 [20, 40] % (null 10 %, 95 % point 25 %), 1.2 [0.5, 1.9] nats/min of log score'
    """
    return ", ".join(gains(of)).replace(", (", " (")


def gains(of: Finding | Report) -> list[str]:
    """The same, piece by piece: of the simulation, the null's in brackets, of the log score; at least one."""
    parts = [percent(of.gain)] if math.isfinite(of.gain.value) else []
    if parts and of.null_gain.replicates:
        parts.append(f"({null_gain(of.null_gain)})")
    if math.isfinite(of.log_score_gain.value):
        parts.append(f"{interval(of.log_score_gain, 'nats/min')} of log score")
    return parts or [percent(of.gain)]


def null_gain(null: NullGain) -> str:
    """Gain of the simulation that the same effects have without being there."""
    return f"null {number(100 * null.median, '%')}, 95 % point {number(100 * null.high, '%')}"


def known_parameters(report: Report) -> dict[str, tuple[Interval, Interval]]:
    """Parameters of the baseline and of the extended model, where at least one of the two may be quoted."""
    known = {}
    for name, channel in report.baseline.channels.items():
        after = report.extended.channels.get(name, channel)
        for what in SYMBOLS:
            both = report.shifts.get(f"{name} {what}", (getattr(channel, what), getattr(after, what)))
            if any(identifiability.quotable(ch, what) for ch in (channel, after)):
                known[f"{name} {what}"] = both
    return known


def advice(report: Report) -> list[str]:
    """What to drive, without what the reasons of `not_testable` contain already."""
    reasons = " ".join(of.why for of in report.not_testable)
    return [line for line in report.advice if line.partition(": ")[2] not in reasons or ": " not in line]


def rms_error(of: Trajectory, simulated: Array) -> float:
    """Root mean square of a trajectory's error, where it was simulated."""
    here = np.isfinite(simulated) & np.isfinite(of.measured)
    return float(np.sqrt(np.mean((simulated - of.measured)[here] ** 2))) if here.any() else math.nan


def has_extended(of: Trajectory) -> bool:
    """Whether the extended model simulates this trajectory differently from the baseline."""
    return math.isfinite(of.gain.value)


class ModelError(NamedTuple):
    """A model and its error in closed loop on held-out data."""

    name: str
    error: ClosedLoopError
    parameters: str  # as text; "" of canid's own models


def closed_loop_models(report: Report) -> list[ModelError]:
    """Both models of canid and the published ones that were calibrated, the smallest error of the gap first."""
    roles = {of.role: of for of in report.closed_loop}
    found = []
    if {"gap", "speed"} <= roles.keys():
        gap, speed = roles["gap"], roles["speed"]
        before = ClosedLoopError(nrmse(gap.before, gap.measured), nrmse(speed.before, speed.measured))
        found.append(ModelError("canid, baseline", before, ""))
        if has_extended(gap) or has_extended(speed):
            after = ClosedLoopError(nrmse(gap.after, gap.measured), nrmse(speed.after, speed.measured))
            found.append(ModelError("canid, extended", after, ""))
    for one in report.rivals:
        if one.status == "ok":
            units = {name: "" if unit == "1" else unit for name, unit in one.units.items()}
            said = (f"{name} {interval(iv, units[name])}" for name, iv in one.parameters.items())
            found.append(ModelError(one.model, one.nrmse, ", ".join(said)))
    return sorted(found, key=lambda one: one.error.gap)


def recommendation(report: Report) -> str:
    """Which model to simulate with behind another lead, as a sentence."""
    if report.recommended == CANID:
        return "For a simulation behind another lead take canid's model: no published one's error of the gap is 5 % smaller."
    return f"For a simulation behind another lead take {report.recommended}: it has the smallest error of the gap."


def duration(report: Report) -> float:
    """Length of the drive, s."""
    return float(report.t[-1] - report.t[0]) + step(report) if len(report.t) else 0.0


def used_time(report: Report) -> float:
    """Time that the fit uses, s."""
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
