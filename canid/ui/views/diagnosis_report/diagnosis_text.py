"""A diagnosis as text for the terminal; the page shows the same blocks, with all of their items and effects in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from canid.ui.views import closed_loop, search_bounds, signal_text
from canid.ui.views.diagnosis_report import diagnosis_parts as parts
from canid.ui.views.document import terms
from canid.ui.views.document.document import Block, Cell, Listing, Table, chosen
from canid.ui.views.document.document_text import lines
from canid.values.findings import Check, Finding, Report, Trajectory, duration, extends, masked_for, used_time
from canid.values.text.model_equation import equation
from canid.values.text.names import capitalised, either, parameter, readable
from canid.values.text.numbers import (
    chance,
    fit_text,
    gain_unit,
    interval,
    number,
    percent,
    role_unit,
    time_range,
)

# lines of one kind that a terminal shows; the page and the JSON have all
WORST_SHOWN = 3
UNDECIDED_SHOWN = 6
# of one cause; intermittent control has some thousand
EPISODES_SHOWN = 12
VISIBLE_SHOWN = 6
RIVALS = ("model", ">NRMSE of the gap", ">of the speed")


def text(report: Report, log: str = "", vehicle: str = "", width: int | None = None) -> list[str]:
    """What `canid diagnose --details` prints: the verdict first.

    Args:
        report: the diagnosis.
        log: name of the log; default: as it was diagnosed.
        vehicle: name of the vehicle; the same.
        width: columns; None: sentences are not wrapped.
    """
    verdict = f"{parts.TITLES[report.verdict].upper()}: {parts.says(report)}"
    time = [] if report.time is None else [f"time: {signal_text.time(report.time)}"]
    signals = signal_text.findings(report.signals)
    blocks = [
        Listing([verdict, about(report, log, vehicle), *time, *signals, *fit(report), *parts.form(report)]),
        *(finding_block(finding, report) for finding in report.findings),
        loop_blocks(report),
        Listing(
            [
                f"{readable(effect)}: {number(seconds, 's')}"
                for effect, seconds in masked_for(report.masked).items()
            ],
            "masked before the fit: not the driver's response",
        ),
        unexplained(report),
        _first(undecided(report), UNDECIDED_SHOWN, "in --json and --report"),
        _first(visible(report), VISIBLE_SHOWN, "in --json"),
        Listing(parts.advice(report), "a drive that would decide"),
        _parameters(report),
        Listing(report.without_causes),
        drives(report),
        model(report),
        *_checks(report),
        Listing(worst(report).items[:WORST_SHOWN], "worst windows"),
        closed_loops(report),
        rivals(report),
    ]
    return lines([*blocks, Listing(terms.used(lines(blocks)), "terms")], width)


def about(report: Report, log: str = "", vehicle: str = "") -> str:
    """Which drive it is, and how much of it was used."""
    drive = f"{log or report.provenance.log or 'drive'}: {vehicle or report.provenance.vehicle or 'vehicle not named'}"
    return f"{drive}, {number(duration(report), 's')}, {number(used_time(report), 's')} of them used"


def _first(listing: Listing, most: int, where: str) -> Listing:
    more = len(listing.items) - most
    return listing._replace(
        items=[*listing.items[:most], *([f"and {more} more, {where}"] if more > 0 else [])]
    )


def fit(report: Report) -> list[str]:
    """How well both models simulate the drive, and how many causes were tried; none where there is no simulation."""
    before, after = report.baseline.fit_percent, report.extended.fit_percent
    if before != before:
        return []
    further = f", of the extended model {fit_text(after)}" if extends(report) else ""
    return [f"fit of the simulation {fit_text(before)}{further}; {report.candidates_tried} causes tried"]


def finding_block(finding: Finding, report: Report) -> Listing:
    """A cause: what it is, its evidence, its parameters, when it was there, and what explains the data as well."""
    helps = "it helps, but is not the cause" if finding.gain.value > 0 else "not the cause"
    values, decides = parts.finding_parameters(finding), parts.would_decide(finding)
    evidence = f"evidence {number(finding.evidence)} (needed {number(finding.needed)})"
    items = [
        search_bounds.without_intervals(finding.says, report),
        f"{evidence}, gain {parts.gain(finding)} on held-out data",
        *([", ".join(values)] if values else []),
        *([_episodes(finding)] if finding.episodes else []),
        f"rivals: {', '.join(parts.rivals(finding)) or 'none'}",
        *([f"what would decide between them: {decides}"] if decides else []),
    ]
    return Listing(
        items, f"{readable(finding.effect)} ({finding.where}{f', surrogate: {helps}' * finding.surrogate})"
    )


def _episodes(finding: Finding) -> str:
    """When it was there: the first episodes, and how many there are."""
    shown = ", ".join(time_range(*each) for each in finding.episodes[:EPISODES_SHOWN])
    more = len(finding.episodes) - EPISODES_SHOWN
    return f"at {shown}{f' and {more} times more, in --json' if more > 0 else ''}"


def loop_blocks(report: Report) -> Listing:
    """The blocks of the loop with their states."""
    each = [
        f"{block.where} ({parts.block_state(block)}): {parts.block_says(block, report)}"
        for block in report.blocks
    ]
    return Listing(each, "blocks of the loop")


def unexplained(report: Report) -> str:
    """What is left; "" where it is not known."""
    known = math.isfinite(report.unexplained.value)
    return f"share of the residual that no cause explains: {percent(report.unexplained)}" if known else ""


def undecided(report: Report) -> Listing:
    """One line per reason; causes with the same reason share it."""
    by_reason: dict[str, list[str]] = {}
    for entry in report.not_testable:
        by_reason.setdefault(entry.why, []).append(either(entry.effects))
    each = [f"{', '.join(names)}: {why}" for why, names in by_reason.items()]
    return Listing(each, "not testable on this drive")


def visible(report: Report) -> Listing:
    """What the drive could have shown, and what else could bias K of range rate; those that bias it most first."""
    each = []
    for entry in report.visible:
        unit, bends = "" if entry.unit == "1" else entry.unit, number(100 * abs(entry.bends), "%", digits=2)
        if math.isfinite(entry.strength):
            least = number(entry.strength, unit, digits=2)
            seen = f"{readable(entry.effect)} from {entry.parameter} {least} on"
            then = f"; a weaker one biases K of range rate by up to {bends}"
        else:
            seen = f"{readable(entry.effect)}: no {entry.parameter} up to eight times the typical one"
            then = f", which would bias K of range rate by {bends}"
        each.append(f"{seen}{then if math.isfinite(entry.bends) else ''}")
    return Listing(each, "strength from which on a cause would have shown, nine times out of ten")


def _parameters(report: Report) -> Table:
    extended = extends(report)
    rows = []
    for key, both in parts.known_parameters(report).items():
        name, unit = parameter(key, report.output)
        texts = [parts.estimate(key, iv, report) for iv in both[: 1 + extended]]
        rows.append((f"{name} ({unit})" if unit else name, *texts))
    title = "driver parameters: baseline, extended model" if extended else "driver parameters"
    return Table([""] * (2 + extended), rows, title)


def drives(report: Report) -> Listing:
    """What each of several drives says of the findings, and of the driver."""
    each = []
    for drive in report.drives:
        gains = [f"{readable(effect)} {interval(iv, 'nats/min')}" for effect, iv in drive.gains.items()]
        responses = [
            f"K of {readable(role)} {interval(channel.K, gain_unit(report.output, role))}, "
            f"τ+θ {interval(channel.tau_plus_dead_time, 's')}"
            for role, channel in drive.channels.items()
        ]
        said = [*responses, *([f"gain of {', '.join(gains)}"] if gains else [])]
        each.append(f"{drive.name} ({number(drive.used, 's')}): {'; '.join(said) or 'too short'}")
    differ = [capitalised(difference) + "." for difference in report.differ]
    return Listing([*each, *differ], "drive by drive, each held against a fit to the others")


def model(report: Report) -> Listing:
    """The final model with its units, and what of it is at a bound."""
    if report.model is None:
        return Listing(())
    items = [equation(report.model), parts.model_units(report), *parts.model_bounds(report)]
    return Listing(items, "final model; L(τ, θ): lag τ, dead time θ")


def passed(checks: Sequence[Check]) -> str:
    """How many of the checks that could be made passed."""
    made = [check for check in checks if check.passed is not None]
    return f"{sum(bool(check.passed) for check in made)} of {len(made)} passed"


def _checks(report: Report) -> list[Block]:
    title = f"checks: {passed(report.checks)}"
    failed = [
        f"✗ {'adequacy, ' * c.gate}{readable(c.name)}: {c.says} ({_against(c)})"
        for c in report.checks
        if c.passed is not None and not c.passed
    ]
    return [Listing(failed, title) if failed else title] if report.checks else []


def _against(c: Check) -> str:
    """Value and limit; an adequacy test fails where its p-value is below the limit."""
    value, limit = number(c.value, c.unit), number(c.limit, c.unit)
    return f"p-value {chance(c.value)}, fails below {limit}" if c.gate else f"{value}, limit {limit}"


def worst(report: Report) -> Listing:
    """Rms of the residual in the worst windows."""
    unit = role_unit(report.output)
    each = [
        f"{time_range(w.start, w.stop)}: residual {number(w.before, unit)} rms"
        + (f", extended model {number(w.after, unit)}" if extends(report) else "")
        for w in report.worst
    ]
    return Listing(each, "worst windows")


def closed_loops(report: Report) -> Listing:
    """Errors in closed loop, a line per quantity."""
    return Listing(
        [_closed_loop(trajectory) for trajectory in report.closed_loop],
        "closed loop, with the lead vehicle of the log",
    )


def _closed_loop(trajectory: Trajectory) -> str:
    role, _, numbers = closed_loop.errors(trajectory).partition(" ")
    line = f"{role}: error {numbers}"
    if not closed_loop.has_extended(trajectory):
        return line
    lost = ": worse with the extended model" * closed_loop.worse(trajectory)
    return f"{line}, error variance {closed_loop.change(trajectory)} on held-out data{lost}"


def rivals(report: Report, head: Sequence[str] = RIVALS, caption: str = "") -> Table:
    """Errors of published models and of canid's, which to take, and why one is missing."""
    models = parts.closed_loop_models(report) if report.rivals else []
    rows: list[dict[str, Cell]] = [
        {
            RIVALS[0]: model.name,
            RIVALS[1]: number(100 * model.error.gap, "%"),
            RIVALS[2]: number(100 * model.error.speed, "%"),
            "parameters": model.parameters,
        }
        for model in models
    ]
    notes = [parts.recommendation(report)] if models and report.recommended else []
    title = "published car-following models in closed loop, on held-out data"
    table = chosen(head, rows, title=title, caption=caption, kind="cards")
    return table._replace(notes=[*notes, *dict.fromkeys(rival.says for rival in report.rivals if rival.says)])
