"""Verdict and its sentence: of the driver's block alone, and of all blocks of the loop together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import SIGMAS
from canid.models.diagnosis.adequacy.adequacy import Adequacy
from canid.models.diagnosis.remnant.remnant_block import WHERE, gained_by
from canid.models.diagnosis.vehicle import pedal_record
from canid.models.effects import CATALOGUE
from canid.values.findings import Blocked, Finding, NotTestable, NullGain, Verdict, Window
from canid.values.text.names import readable
from canid.values.text.numbers import p_text
from canid.values.types import Interval

# in the order of the control loop, in which they are diagnosed as well
BLOCKS = ("sensing", "vehicle", "driver")
# of the car's residual: torque that falls with the speed and gears that no signal shows leave 2.5 to 5 % on most cars
ORDINARY_CAR_SHARE = 0.1


class Gained(NamedTuple):
    """What the driver's findings gain together, on held-out data."""

    gain: Interval  # of the simulation's error variance
    null: NullGain  # the same on drives without them
    log_score: Interval  # nats/min
    predicted: bool = True  # the gain's interval is where that of another drive lies, behind another lead


def of_driver(findings: tuple[Finding, ...], passed: bool) -> Verdict:
    """Verdict of the driver's findings; `passed`: of the adequacy tests."""
    if not passed:
        return Verdict.UNEXPLAINED
    if not findings:
        return Verdict.ADEQUATE
    return Verdict.ONE_OF if any(finding.rivals for finding in findings) else Verdict.NAMED


def state(verdict: Verdict) -> str:
    """State of the driver's block."""
    return {Verdict.ADEQUATE: "adequate", Verdict.UNEXPLAINED: "unexplained"}.get(verdict, "wrong")


def failed(held: Adequacy) -> list[str]:
    """What the residual still holds."""
    return [f"{f.says} ({p_text(f.p)}, {100 * f.share:.0f} % of the residual)" for f in held.failed]


def says(
    findings: tuple[Finding, ...], held: Adequacy, worst: tuple[Window, ...], gained: Gained, tried: int
) -> str:
    """Verdict line of the driver's block alone.

    Args:
        findings: of the block.
        held: adequacy tests of its last model.
        worst: windows with the largest residual.
        gained: by all findings.
        tried: number of candidates.
    """
    verdict, better = of_driver(findings, held.passed), gained_line(gained)
    if verdict is Verdict.ADEQUATE:
        return (
            f"ADEQUATE: none of {tried} causes explains more than chance, "
            "and the residual holds nothing of the inputs."
        )
    if verdict is Verdict.UNEXPLAINED:
        what = "; ".join(failed(held))
        names = ", ".join(readable(finding.effect) for finding in findings)
        helps = "helps, but" if gained.gain.value > 0 else "predicts the next sample better, but"
        surrogate = f" {names} {helps} is not the cause." if findings else ""
        where = max(worst, key=lambda window: window.after, default=None)
        most = f" Most of it is at {where.start:.0f} to {where.stop:.0f} s." if where is not None else ""
        return f"UNEXPLAINED: the residual holds {what}.{most}{surrogate}{better}"
    if verdict is Verdict.ONE_OF:
        sets = " and ".join(map(_choice, findings))
        return f"ONE OF: {sets}.{better}"
    return f"CAUSE: {' '.join(finding.says for finding in findings)}{better} The residual holds nothing more."


def unexplained(held: Adequacy) -> Interval:
    """Share of the residual's variance that the strongest failed family would explain."""
    if not held.failed:
        return Interval(0.0, 0.0, max((f.share for f in held.families), default=0.0))
    worst = max(held.failed, key=lambda f: f.share)
    # the statistic is a noncentral chi-squared: its standard deviation is sqrt(2 (k + 2 λ))
    half = SIGMAS * float(np.sqrt(2 * (worst.dimensions + 2 * worst.statistic))) / max(worst.statistic, 1e-9)
    return Interval(worst.share, max(worst.share * (1 - half), 0.0), min(worst.share * (1 + half), 1.0))


def decided(findings: tuple[Finding, ...], lines: tuple[Blocked, ...], missed: float = 1.0) -> Verdict:
    """Overall verdict: that of the block that fails, before any cause that another one names.

    Of a car that is unexplained by as little as every car is, the driver's verdict holds. The law of the noise is no cause
    of what the mean leaves: where only the remnant has findings, the mean law is adequate.

    Args:
        findings: of all blocks.
        lines: the blocks.
        missed: share of the car's residual that depends on pedal and speed.

    Example:
        >>> lines = Blocked("vehicle", "unexplained", ""), Blocked("driver", "adequate", "")
        >>> decided((), lines, 0.04), decided((), lines, 0.3)
        (<Verdict.ADEQUATE: 'adequate'>, <Verdict.UNEXPLAINED: 'unexplained'>)
    """
    ordinary = missed < ORDINARY_CAR_SHARE
    named = [finding for finding in findings if finding.where != WHERE and not finding.surrogate]
    by_cause = {finding.where for finding in named}
    if any(
        line.state == "unexplained" and not (line.where == "vehicle" and (ordinary or by_cause))
        for line in lines
    ):
        return Verdict.UNEXPLAINED
    if named:
        return Verdict.ONE_OF if any(finding.rivals for finding in named) else Verdict.NAMED
    return Verdict.ADEQUATE


def sentence(
    verdict: Verdict, findings: tuple[Finding, ...], lines: tuple[Blocked, ...], driver: Gained, tried: int
) -> str:
    """Verdict line: block, cause, and gain."""
    left = " ".join(
        f"Something is left in the {line.where}: {line.says}" for line in lines if line.state == "unexplained"
    )
    noise = lines[-1]
    law = f" The remnant: {noise.says}" if noise.where == WHERE and noise.state == "wrong" else ""
    tail = f" {left}" if left else ""
    if verdict is Verdict.UNEXPLAINED:
        others = [f"{_choice(f)} in the {f.where}" for f in findings if f.where != WHERE and not f.surrogate]
        also = f" Found as well: {', '.join(others)}." if others else ""
        return f"UNEXPLAINED: {left}{also}{law}"
    if verdict is Verdict.ADEQUATE:
        chosen = [_choice(finding) for finding in findings if finding.where == WHERE]
        if chosen:
            either = f" ({', '.join(chosen)})" if any(f.rivals for f in findings if f.where == WHERE) else ""
            return f"ADEQUATE: Mean law adequate. The remnant{either}: {noise.says}{tail}"
        states = ", ".join(f"{line.where} {readable(line.state)}" for line in lines)
        return (
            f"ADEQUATE: none of {tried} causes explains more than chance, "
            f"and the driver's residual holds nothing of the inputs ({states}).{tail}"
        )
    parts = []
    for where in BLOCKS:
        here = [finding for finding in findings if finding.where == where and not finding.surrogate]
        if not here:
            continue
        if verdict is Verdict.ONE_OF:
            places = dict.fromkeys(place for finding in here for place in (where, *_places(finding)))
            parts.append(f"in the {' or the '.join(places)} " + " and ".join(map(_choice, here)))
        else:
            causes = " ".join(
                finding.says + (_better(finding.gain) if where != "driver" else "") for finding in here
            )
            parts.append(f"In the {where}: {causes}")
    better = gained_line(driver) if any(f.where == "driver" and not f.surrogate for f in findings) else ""
    if verdict is Verdict.ONE_OF:
        return f"ONE OF: {'; '.join(parts)}.{better}{tail}{law}"
    passed = "" if left else " The residual holds nothing more."
    return f"CAUSE: {' '.join(parts)}{better}{passed}{tail}{law}"


def gained_line(gained: Gained) -> str:
    """What the driver's findings gain: of the simulation, next to what the null gives, and of the log score."""
    null, gain = gained.null, gained.gain
    better = (
        _better(gain, " on held-out data; expected behind another lead", "")
        if gained.predicted
        else _better(gain)
    )
    if better and null.replicates:
        without = (
            f"{-100 * null.median:+z.0f} % in the median, beyond {-100 * null.high:+z.0f} % in one of 20"
        )
        beyond = gain.value > null.high
        better = better[:-1] + (
            f" (without the cause, by the driver's own noise in the loop: {without})."
            if beyond
            else f", no more than without the cause, by the driver's own noise in the loop ({without})."
        )
    if gained.log_score.value == gained.log_score.value:
        better += f" One-step predictions: {gained_by(gained.log_score)}."
    return better


def _better(gain: Interval, between: str = "", after: str = " on held-out data") -> str:
    """A gain, what is said before its interval, and after."""
    if gain.value != gain.value:
        return ""
    change, low, high = -100 * gain.value, -100 * gain.high, -100 * gain.low
    return f" Error variance {change:+z.0f} %{between} [{low:+z.0f}, {high:+z.0f}]{after}."


def _places(finding: Finding) -> list[str]:
    """Blocks that its rivals are in."""
    recorded = ["sensing"] * (pedal_record.END_OF_RECORD in finding.rivals)
    return [*recorded, *(effect.where for effect in CATALOGUE if effect.id in finding.rivals)]


def _choice(finding: Finding) -> str:
    names = ", ".join(map(readable, (finding.effect, *finding.rivals)))
    return f"one of {names}" if finding.rivals else names


def body(says: str) -> str:
    """A block's line without the verdict's word before it."""
    head, colon, rest = says.partition(": ")
    return rest[:1].upper() + rest[1:] if colon and head.isupper() else says


def still_undecided(line: NotTestable, named: frozenset[str]) -> tuple[NotTestable, ...]:
    """What a line leaves undecided next to what was named; of a pair of which one is named, nothing.

    Example:
        >>> still_undecided(NotTestable(("a", "b", "c"), "why", 9.0, 13.0), frozenset({"b"}))
        (NotTestable(effects=('a', 'c'), why='why', evidence=9.0, needed=13.0),)
    """
    left = tuple(effect for effect in line.effects if effect not in named)
    if left == line.effects:
        return (line,)
    return (line._replace(effects=left),) if len(left) > 1 else ()
