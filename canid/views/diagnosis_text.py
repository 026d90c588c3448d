"""A diagnosis as text for the terminal."""

from __future__ import annotations

import math

from canid.findings import Check, Finding, Report, Trajectory, extends, masked_for
from canid.identified_model import equation
from canid.views import closed_loop, search_bounds, signal_text
from canid.views.diagnosis_parts import (
    advice,
    block_says,
    closed_loop_models,
    duration,
    estimate,
    finding_parameters,
    form,
    gain,
    known_parameters,
    model_bounds,
    model_units,
    recommendation,
    says,
    used_time,
)
from canid.views.names import capitalised, parameter, readable
from canid.views.numbers import gain_unit, interval, number, percent, role_unit, time_range
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
    lines = [f"{verdict}: {says(report)}", *_about(report, log, vehicle)]
    for finding in report.findings:
        lines += ["", *_finding(finding, report)]
    blocks = [
        f"{block.where} ({readable(block.state)}): {block_says(block, report)}" for block in report.blocks
    ]
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
        lines += _headed(
            "final model; L(τ, θ): lag τ, dead time θ",
            [equation(report.model), model_units(report), *model_bounds(report)],
        )
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


def _finding(finding: Finding, report: Report) -> list[str]:
    helps = "it helps, but is not the cause" if finding.gain.value > 0 else "not the cause"
    title = f"{finding.effect} ({finding.where}{f', surrogate: {helps}' * finding.surrogate})"
    evidence = f"evidence {number(finding.evidence)} (needed {number(finding.needed)})"
    lines = [
        title,
        f"  {search_bounds.without_intervals(finding.says, report)}",
        f"  {evidence}, gain {gain(finding)} on held-out data",
    ]
    values = finding_parameters(finding)
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
    """What the drive could have shown, and what else could bias K of range rate; those that bias it most first."""
    lines = []
    for of in report.visible:
        unit, bends = "" if of.unit == "1" else of.unit, f"{100 * abs(of.bends):.2g} %"
        if math.isfinite(of.strength):
            seen = f"{of.effect} from {of.parameter} {of.strength:.2g}{f' {unit}' if unit else ''} on"
            then = f"; a weaker one biases K of range rate by up to {bends}"
        else:
            seen = f"{of.effect}: at no {of.parameter} up to eight times the typical one"
            then = f", which would bias K of range rate by {bends}"
        lines.append(f"{seen}{then if math.isfinite(of.bends) else ''}")
    more = len(lines) - VISIBLE_SHOWN
    return [*lines[:VISIBLE_SHOWN], *([f"and {more} more, in --json"] if more > 0 else [])]


def _parameters(report: Report) -> list[str]:
    rows = []
    for key, (before, after) in known_parameters(report).items():
        name, unit = parameter(key, report.output)
        shown = (before, after) if extends(report) else (before,)
        texts = (estimate(key, iv, report) for iv in shown)
        rows.append((f"{name} ({unit})" if unit else name, *texts))
    return columns([""] * len(rows[0]), rows)[1:] if rows else []


def _drives(report: Report) -> list[str]:
    """What each of several drives says of the findings, and of the driver."""
    lines = []
    for one in report.drives:
        gains = [f"{effect} {interval(iv, 'nats/min')}" for effect, iv in one.gains.items()]
        own = [
            f"K of {readable(name)} {interval(channel.K, gain_unit(report.output, name))}, "
            f"τ+θ {interval(channel.tau_plus_dead_time, 's')}"
            for name, channel in one.channels.items()
        ]
        said = [*own, *([f"gain of {', '.join(gains)}"] if gains else [])]
        lines.append(f"{one.name} ({number(one.used, 's')}): {'; '.join(said) or 'too short'}")
    return [*lines, *(capitalised(says) + "." for says in report.differ)]


def _checks(report: Report) -> list[str]:
    made = [c for c in report.checks if c.passed is not None]
    failed = [c for c in made if not c.passed]
    lines = [f"✗ {'adequacy, ' * c.gate}{readable(c.name)}: {c.says} ({_against(c)})" for c in failed]
    title = f"checks: {len(made) - len(failed)} of {len(made)} passed"
    return _headed(title, lines, always=True) if report.checks else []


def _against(c: Check) -> str:
    """Value and limit; of an adequacy test its p-value, which fails below the limit."""
    value, limit = number(c.value, c.unit), number(c.limit, c.unit)
    return f"p {value}, fails below {limit}" if c.gate else f"{value}, limit {limit}"


def _worst(report: Report) -> list[str]:
    unit = role_unit(report.output)
    return [
        f"{time_range(w.start, w.stop)}: residual {number(w.before, unit)} rms"
        + (f", extended model {number(w.after, unit)}" if extends(report) else "")
        for w in report.worst[:WORST_SHOWN]
    ]


def _closed_loop(of: Trajectory) -> str:
    role, _, numbers = closed_loop.errors(of).partition(" ")
    line = f"{role}: error {numbers}"
    if not closed_loop.has_extended(of):
        return line
    lost = ": worse with the extended model" * closed_loop.worse(of)
    return f"{line}, error variance {closed_loop.change(of)} on held-out data{lost}"


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
