"""Parts of a diagnosis that its text, its JSON and its page share: sentences, estimates, gains, models."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from canid.mathematics.identification import identifiability
from canid.models.diagnosis.rivals.recommendation import CANID
from canid.models.effects import CATALOGUE
from canid.ui.views import closed_loop, search_bounds
from canid.values.findings import (
    Blocked,
    ClosedLoopError,
    Finding,
    NullGain,
    Report,
    RivalCause,
    Verdict,
    nrmse,
    step,
)
from canid.values.text.names import SYMBOLS, parameter, readable
from canid.values.text.numbers import decimals, gain_unit, interval, number, percent, role_unit
from canid.values.types import Interval

TITLES = {
    Verdict.ADEQUATE: "The simulation is adequate",
    Verdict.NAMED: "Cause found",
    Verdict.ONE_OF: "One of these causes",
    Verdict.UNEXPLAINED: "Unexplained",
    Verdict.NOT_ENOUGH_DATA: "Not enough data",
}


def says(report: Report) -> str:
    """The verdict: its sentence and its remarks."""
    return " ".join([sentence(report), *remarks(report)])


def remarks(report: Report) -> list[str]:
    """What stands in the verdict as well: contradictions, a closed loop that gets worse, parameters of causes at a bound."""
    lost = closed_loop.warning(report)
    return [*report.contradictions, *([lost] if lost else []), *search_bounds.remarks(report)]


def sentence(report: Report) -> str:
    """The verdict's sentence without the word in capitals that it may begin with.

    Example:
        >>> from types import SimpleNamespace
        >>> sentence(SimpleNamespace(says="ONE OF: one of a, b.", findings=()))
        'one of a, b.'
    """
    return without_verdict(search_bounds.without_intervals(report.says, report))


def block_says(block: Blocked, report: Report) -> str:
    """What a block says, without the verdict's word; what the verdict says of it is not said again."""
    said = without_verdict(search_bounds.without_intervals(block.says, report))
    return "as said above" if said and said in sentence(report) else said


def block_state(block: Blocked) -> str:
    """The state of a block in words; a law of the noise that is not Gaussian is nothing wrong with the driver.

    Example:
        >>> block_state(Blocked("remnant", "wrong", "")), block_state(Blocked("vehicle", "not_testable", ""))
        ('not Gaussian', 'not testable')
    """
    return "not Gaussian" if (block.where, block.state) == ("remnant", "wrong") else readable(block.state)


def without_verdict(line: str) -> str:
    """A sentence without the verdict in capitals that it may begin with.

    Example:
        >>> without_verdict("ADEQUATE: none of 6 causes explains more than chance.")
        'none of 6 causes explains more than chance.'
    """
    return re.sub(r"^[A-Z][A-Z ]+: ", "", line)


def form(report: Report) -> list[str]:
    """Which gap the extended model wants at a speed, with its parameters; [] where nothing was fitted."""
    wanted_gap = report.extended.form
    if wanted_gap is None:
        return []
    at = search_bounds.of_fit(report.extended)
    values = [
        f"{name} {search_bounds.text(iv, wanted_gap.units[name], at.get(name))}"
        for name, iv in wanted_gap.parameters.items()
    ]
    return [f"baseline: {wanted_gap.says}{': ' if values else ''}{', '.join(values)}"]


def rivals(finding: Finding) -> list[str]:
    """What explains the data as well as a cause, with its size where it was fitted."""
    sizes = {each.effect: ", ".join(finding_parameters(each)) for each in finding.rival_causes}
    return [
        f"{readable(rival)} ({sizes[rival]})" if sizes.get(rival) else readable(rival)
        for rival in finding.rivals
    ]


def would_decide(finding: Finding) -> str:
    """Which drive or signal distinguishes a cause from its rivals; "": it has none, or nothing is known to."""
    by = {effect.id: effect.decides for effect in CATALOGUE}
    names = (finding.effect, *finding.rivals) if finding.rivals else ()
    return "; or ".join(dict.fromkeys(by[name] for name in names if by.get(name)))


def finding_parameters(finding: Finding | RivalCause) -> list[str]:
    """Parameters of a cause or rival, with interval and unit, or at which bound they are."""
    at = search_bounds.of_finding(finding)
    return [
        f"{readable(name)} {search_bounds.text(iv, finding.units.get(name, ''), at.get(name))}"
        for name, iv in finding.parameters.items()
    ]


def estimate(key: str, iv: Interval, report: Report) -> str:
    """A parameter of the driver as text without its unit, which the table has; at a bound with it."""
    at = search_bounds.of_parameter(key, iv, 0.5 * step(report))
    return interval(iv) if at is None else search_bounds.text(iv, parameter(key, report.output)[1], at)


def model_bounds(report: Report) -> list[str]:
    """Sentence on the parameters of the final model that are at a bound of what is searched; [] where none is."""
    if report.model is None:
        return []
    bounds = search_bounds.of_model(report.model.driver, report.model.form)
    names = [f"{name} ({at.side} bound, {number(at.end, at.unit)})" for name, at in bounds.items()]
    return [f"not estimated, at a bound of what is searched: {', '.join(names)}"] if names else []


def model_units(report: Report) -> str:
    """Units of the equation of the final model."""
    gains = [gain_unit(report.output, name) for name in ("headway_error", "range_rate")]
    return f"{report.output}, its offset and n in {role_unit(report.output)}; gains in {gains[0]} and in {gains[1]}"


def not_quoted(report: Report) -> list[str]:
    """Why no parameter may be quoted, input by input."""
    return [
        f"{readable(name)}: {readable(channel.status.value)}"
        for name, channel in report.extended.channels.items()
    ]


def gain(judged: Finding | Report) -> str:
    """What a finding, or all of the driver's together, gain on held-out data: of the simulation and of the log score.

    Example:
        >>> from canid.values.findings import NullGain
        >>> from types import SimpleNamespace
        >>> found = SimpleNamespace(gain=Interval(0.3, 0.2, 0.4), log_score_gain=Interval(1.2, 0.5, 1.9))
        >>> found.null_gain = NullGain(0.1, 0.25, 19)
        >>> gain(found)
        '30 [20, 40] % (null 10 %, 95 % point 25 %), 1.2 [0.5, 1.9] nats/min of log score'
    """
    return ", ".join(gains(judged)).replace(", (", " (")


def gains(judged: Finding | Report) -> list[str]:
    """The same, piece by piece: of the simulation, the null's in brackets, of the log score; at least one."""
    parts = [percent(judged.gain)] if math.isfinite(judged.gain.value) else []
    if parts and judged.null_gain.replicates:
        parts.append(f"({null_gain(judged.null_gain)})")
    if math.isfinite(judged.log_score_gain.value):
        parts.append(f"{interval(judged.log_score_gain, 'nats/min')} of log score")
    return parts or [percent(judged.gain)]


def null_gain(null: NullGain) -> str:
    """Gain of the simulation that the same effects have without being there."""
    return f"null {number(100 * null.median, '%', digits=2)}, 95 % point {number(100 * null.high, '%', digits=2)}"


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
    """What to drive, without what reasons and rivals contain already."""
    reasons = " ".join([*(entry.why for entry in report.not_testable), *map(would_decide, report.findings)])
    return [line for line in report.advice if line.partition(": ")[2] not in reasons or ": " not in line]


class ModelError(NamedTuple):
    """A model and its error in closed loop on held-out data."""

    name: str
    error: ClosedLoopError
    parameters: str  # as text; "" of canid's own models


def closed_loop_models(report: Report) -> list[ModelError]:
    """Both models of canid and the published ones that were calibrated, the smallest error of the gap first."""
    roles = {trajectory.role: trajectory for trajectory in report.closed_loop}
    errors = []
    if {"gap", "speed"} <= roles.keys():
        gap, speed = roles["gap"], roles["speed"]
        before = ClosedLoopError(nrmse(gap.before, gap.measured), nrmse(speed.before, speed.measured))
        errors.append(ModelError("canid, baseline", before, ""))
        if closed_loop.has_extended(gap) or closed_loop.has_extended(speed):
            after = ClosedLoopError(nrmse(gap.after, gap.measured), nrmse(speed.after, speed.measured))
            errors.append(ModelError("canid, extended", after, ""))
    for rival in report.rivals:
        if rival.status == "ok":
            at = search_bounds.of_rival(rival)
            said = (
                f"{name} {search_bounds.text(iv, rival.units[name], at.get(name))}"
                for name, iv in rival.parameters.items()
            )
            errors.append(ModelError(rival.model, rival.nrmse, ", ".join(said)))
    return sorted(errors, key=lambda entry: entry.error.gap)


def recommendation(report: Report) -> str:
    """Which model to simulate with behind another lead, as a sentence."""
    if report.recommended == CANID:
        return "For a simulation behind another lead take canid's model: no published one's error of the gap is 5 % smaller."
    return f"For a simulation behind another lead take {report.recommended}: it has the smallest error of the gap."


def shift(before: Interval, after: Interval) -> str:
    """How far the extended model moves a parameter, and whether out of the baseline's interval.

    Example:
        >>> shift(Interval(4.42, 3.58, 5.21), Interval(7.71, 6.6, 8.8))
        '+3.3 (+74 %), outside the baseline interval'
        >>> shift(Interval(), Interval(7.71, 6.6, 8.8))
        '–'
    """
    if not (math.isfinite(before.value) and math.isfinite(after.value)):
        return "–"
    digits = max(decimals(before), decimals(after))
    by = after.value - before.value
    moved = round(by, digits) + 0.0  # no "-0.0"
    share = f" ({100 * by / abs(before.value):+.0f} %)" if moved and before.value else ""
    inside = before.low <= after.value <= before.high
    return f"{moved:+.{digits}f}{share}, {'within' if inside else 'outside'} the baseline interval"
