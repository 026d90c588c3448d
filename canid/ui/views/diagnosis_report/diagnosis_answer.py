"""A diagnosis in a few plain sentences: what the model misses, what it gains to know it, and what to drive next."""

from __future__ import annotations

import math
from collections.abc import Iterable

from canid.analysis.drive.response_sentence import response
from canid.ui.views import closed_loop, search_bounds, signal_text
from canid.ui.views.diagnosis_report import diagnosis_parts as parts
from canid.ui.views.diagnosis_report import diagnosis_text
from canid.ui.views.document.document_text import wrapped
from canid.ui.views.document.screen import Part, cut
from canid.values.findings import (
    Finding,
    Report,
    Trajectory,
    Verdict,
    Visible,
    extends,
    used_time,
)
from canid.values.text.names import capitalised, either, readable
from canid.values.text.numbers import number, role_unit
from canid.values.types import Interval

# effects that the drive would have shown which are named in the answer; the details have all
VISIBLE = 2
# and those which it would have hidden
HIDDEN = 6
# lines of the summary, and drives that it advises
MAX_LINES, ADVICE = 30, 2
# min; longer drives than that nobody plans for one cause
MORE_MINUTES = 60
# the blocks whose findings change what a simulation does
_MEAN = ("driver", "vehicle", "sensing")


def answer(report: Report) -> list[str]:
    """The sentences, the most important one first; what is missing is left out.

    Example:
        >>> from types import SimpleNamespace
        >>> seen = Visible("gear_drift", "rate", 0.35, "1", 0.1)
        >>> one = SimpleNamespace(verdict=Verdict.ADEQUATE, findings=(), visible=(seen,), output="pedal")
        >>> one.without_causes = one.not_testable = ()
        >>> one.extended = SimpleNamespace(channels={})
        >>> answer(one)
        ['Nothing is wrong with the model that this drive could show. A gear drift from 0.35 on would have.']
    """
    first = {
        Verdict.ADEQUATE: _adequate,
        Verdict.NAMED: _named,
        Verdict.ONE_OF: _named,
        Verdict.UNEXPLAINED: _unexplained,
    }.get(report.verdict, parts.sentence)(report)
    driver = response(report.extended.channels, report.output)
    return [said for said in (first, *_gained(report), driver, *report.without_causes) if said]


def summary(report: Report, log: str = "", vehicle: str = "", more: str = "") -> list[str]:
    """What `canid diagnose` prints: at most `MAX_LINES` of 80 columns, the answer first.

    Args:
        report: the diagnosis.
        log: name of the log; default: as it was diagnosed.
        vehicle: name of the vehicle; the same.
        more: where the rest is.
    """
    verdict = parts.TITLES[report.verdict].upper()
    said, *rest = answer(report)
    states = ", ".join(f"{block.where} {parts.block_state(block)}" for block in report.blocks)
    undecided = ", ".join(
        dict.fromkeys(" or ".join(map(readable, entry.effects)) for entry in report.not_testable)
    )
    return cut(
        [
            Part(_lines([f"{verdict}: {said}", *rest]), 99),
            Part([""], 1),
            Part(_lines([diagnosis_text.about(report, log, vehicle)]), 99),
            Part(_lines(signal_text.findings(report.signals)), 3),
            Part(_lines(parts.remarks(report), "⚠ "), 4),
            Part(_lines(certainty(report)), 3),
            Part(_lines([states], "blocks of the loop: "), 2),
            Part(_lines(_to_drive(report)[:ADVICE], "to drive next: "), 4),
            Part(_lines([undecided], "not decidable on this drive: "), 1),
            Part(_lines([more]), 1),
        ],
        MAX_LINES,
    )


def _lines(sentences: Iterable[str], begin: str = "") -> list[str]:
    """Sentences that begin so, in lines; what is empty is left out."""
    return [line for says in sentences if says for line in wrapped(f"{begin}{says}")]


def certainty(report: Report) -> list[str]:
    """How sure each cause is: the evidence, and what chance would have reached."""
    return [
        f"{readable(finding.effect)}: evidence {number(finding.evidence)}, where chance reaches {number(finding.needed)}"
        f"{'; or ' + ' or '.join(parts.rivals(finding)) if finding.rivals else ''}"
        for finding in report.findings
    ]


def _to_drive(report: Report) -> list[str]:
    """What decides between causes and their rivals, of every block; then the advice, the nearest to be decided first."""
    unsure = {readable(finding.effect): finding for finding in report.findings if finding.rivals}
    rivals = [(either((each.effect, *each.rivals)), parts.would_decide(each)) for each in unsure.values()]
    near = {
        either(entry.effects): entry.evidence / entry.needed
        for entry in report.not_testable
        if entry.evidence > 0
    }
    rest = [line for line in report.advice if line.partition(": ")[0] not in unsure]
    rest.sort(key=lambda line: -near.get(line.partition(": ")[0], 0.0))
    return [*(f"{names}: {decides}" for names, decides in rivals if decides), *rest]


def more_minutes(report: Report) -> str:
    """How much longer a drive like this one takes to decide the next cause; "": no cause within `MORE_MINUTES`.

    Evidence grows with the length of a drive.

    Example:
        >>> import numpy as np
        >>> from types import SimpleNamespace
        >>> from canid.values.findings import NotTestable
        >>> undecided = (NotTestable(("cross_wind",), "", 11.0, 13.2), NotTestable(("uphill_start",), "", 1.0, 13.2))
        >>> drive = SimpleNamespace(t=np.arange(1200) / 10, used=np.ones(1200, bool), not_testable=undecided)
        >>> more_minutes(drive)
        'In some 1 min more of such driving a cross wind of typical strength would be seen.'
    """
    used = used_time(report) / 60
    waits = sorted(
        (used * (entry.needed / entry.evidence - 1), entry.effects)
        for entry in report.not_testable
        if entry.evidence > 0
    )
    if not waits or waits[0][0] > MORE_MINUTES:
        return ""
    minutes, effects = waits[0]
    what = _article(readable(" or ".join(effects)))
    return f"In some {math.ceil(minutes)} min more of such driving {what} of typical strength would be seen."


def _adequate(report: Report) -> str:
    seen = _seen(report)
    would = f" {capitalised(' or '.join(map(_visible, seen)))} would have." if seen else ""
    noise = "".join(f" {finding.says}" for finding in report.findings)
    return f"Nothing is wrong with the model that this drive could show.{would}{_hidden(report)}{noise}"


def _seen(report: Report) -> list[Visible]:
    """Those that bend K most of the causes that the drive would have shown."""
    return [visible for visible in report.visible if math.isfinite(visible.strength)][:VISIBLE]


def _hidden(report: Report) -> str:
    """Which causes of ordinary size this drive would have hidden, those that it nearly shows first; "": none is known."""
    seen = {visible.effect for visible in _seen(report)}
    known = [entry for entry in report.not_testable if entry.evidence > 0 and not seen & set(entry.effects)]
    known.sort(key=lambda entry: -entry.evidence)
    every = list(dict.fromkeys(_article(either(entry.effects)) for entry in known))
    each, more = every[:HIDDEN], len(every) - HIDDEN
    said = " or ".join(filter(None, (", ".join(each[:-1]), *each[-1:])))
    rest = f", nor would {more} other{'s' * (more > 1)}" if more > 0 else ""
    return f" {capitalised(said)} of typical strength would not have shown{rest}." if said else ""


def _visible(visible: Visible) -> str:
    unit = "" if visible.unit == "1" else f" {visible.unit}"
    return f"{_article(readable(visible.effect))} from {number(visible.strength, digits=2)}{unit} on"


def _article(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def _named(report: Report) -> str:
    causes = [
        _says(finding, report)
        for finding in report.findings
        if finding.where in _MEAN and not finding.surrogate
    ]
    helps = [readable(finding.effect) for finding in report.findings if finding.surrogate]
    noise = [
        _says(finding, report)
        for finding in report.findings
        if finding.where not in _MEAN and not finding.surrogate
    ]
    # a sentence that the colon introduces
    said = [f"The model misses this: {causes[0][:1].lower()}{causes[0][1:]}"] if causes else []
    said += causes[1:]
    said += [f"{capitalised(' and '.join(helps))} helps, but is not the cause."] if helps else []
    said += [f"Of the noise: {' '.join(noise)}"] if noise else []
    return " ".join(said) or parts.sentence(report)


def _says(finding: Finding, report: Report) -> str:
    """What a cause does, and which other ones would do the same on this drive."""
    said = search_bounds.without_intervals(finding.says, report)
    others = " or ".join(map(_article, map(readable, finding.rivals)))
    return f"{said} Or it is {others}: this drive cannot say which." if others else said


def _unexplained(report: Report) -> str:
    """With the first test that fails, where one does; behind the causes that are named all the same."""
    failed = [check for check in report.checks if check.gate and check.passed is False]
    seen = f": {failed[0].says.rstrip('.')}" if failed else ""
    if any(finding.where in _MEAN and not finding.surrogate for finding in report.findings):
        return f"{_named(report)} Something else is left that no other cause explains{seen}."
    return f"The model misses something that none of {report.candidates_tried} causes explains{seen}."


def _gained(report: Report) -> list[str]:
    """What the simulation gains by the causes of the mean: on this drive, and on another one of this driver."""
    if not extends(report):
        return []
    gap = [
        trajectory
        for trajectory in report.closed_loop
        if trajectory.role == "gap" and closed_loop.has_extended(trajectory)
    ]
    return [*map(_of_gap, gap[:1]), *([_elsewhere(report.gain)] if math.isfinite(report.gain.low) else [])]


def _of_gap(gap: Trajectory) -> str:
    before, after = (closed_loop.rms_error(gap, simulated) for simulated in (gap.before, gap.after))
    unit = role_unit(gap.role)
    said = f"the simulated gap is wrong by {number(after, unit)} instead of {number(before)} {unit} (rms)"
    return f"With it, behind this drive's lead, {said}."


def _elsewhere(gain: Interval) -> str:
    """Less error of the output's simulation on another drive, as its 95 % interval says.

    >>> _elsewhere(Interval(0.5, 0.12, 0.96))
    'On other drives of this driver expect 12 to 96 % less error variance.'
    >>> _elsewhere(Interval(0.1, -0.05, 0.3))
    'On other drives of this driver expect from 5 % more to 30 % less error variance.'
    """
    low, high = (f"{100 * abs(x):.0f}" for x in (gain.low, gain.high))
    if gain.low >= 0:
        return f"On other drives of this driver expect {low} to {high} % less error variance."
    if gain.high >= 0:
        return f"On other drives of this driver expect from {low} % more to {high} % less error variance."
    return f"On other drives of this driver expect {high} to {low} % more error variance."
