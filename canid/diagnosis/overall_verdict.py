"""Overall report of sensing, vehicle, driver and remnant: the verdict, and the block in which a cause sits."""

from __future__ import annotations

from canid.diagnosis.corrections import Context
from canid.diagnosis.remnant import remnant_block
from canid.diagnosis.remnant.remnant_block import RemnantReport
from canid.findings import Blocked, Finding, NotTestable, Report, Verdict
from canid.types import Interval

# in the order of the control loop, in which they are diagnosed as well
BLOCKS = ("sensing", "vehicle", "driver")


def join(driver: Report, remnant: RemnantReport, around: Context) -> Report:
    """Join the driver's report with those of the remnant, of sensing and of the vehicle.

    Args:
        driver: the report of the driver's block alone.
        remnant: the law of the noise that the driver adds.
        around: sensing and vehicle.
    """
    sensing, vehicle = around.sensing, around.vehicle
    own = driver.findings
    if sensing.block.state == "unexplained":
        # the inputs of the driver are uncertain, and so is every cause that was found from them
        own = tuple(finding._replace(surrogate=True) for finding in own)
    findings = (*sensing.findings, *vehicle.findings, *own, *remnant.findings)
    block = driver.blocks[0]
    lines = (sensing.block, vehicle.block, block._replace(says=_body(block.says)), remnant.block)
    verdict = decided(findings, lines)
    tried = (
        driver.candidates_tried + sensing.tried + len({t.effect for t in (*vehicle.tried, *remnant.tried)})
    )
    named = frozenset(finding.effect for finding in findings)
    undecided = (*driver.not_testable, *sensing.not_testable, *vehicle.not_testable)
    return driver._replace(
        verdict=verdict,
        says=sentence(verdict, findings, lines, driver, tried),
        findings=findings,
        # the share is that of the driver's residual: of another block's nothing is known
        unexplained=driver.unexplained
        if verdict is not Verdict.UNEXPLAINED or block.state == "unexplained"
        else Interval(),
        not_testable=tuple(one for line in undecided for one in still_undecided(line, named)),
        candidates_tried=tried,
        tried=(*driver.tried, *vehicle.tried, *remnant.tried),
        checks=(*sensing.checks, *vehicle.checks, *driver.checks),
        blocks=lines,
        steps=(*around.steps, *driver.steps, *remnant.steps),
    )


def still_undecided(line: NotTestable, named: frozenset[str]) -> tuple[NotTestable, ...]:
    """What a line leaves undecided next to what was named; of a pair of which one is named, nothing.

    Example:
        >>> still_undecided(NotTestable(("a", "b", "c"), "why"), frozenset({"b"}))
        (NotTestable(effects=('a', 'c'), why='why'),)
    """
    left = tuple(effect for effect in line.effects if effect not in named)
    if left == line.effects:
        return (line,)
    return (line._replace(effects=left),) if len(left) > 1 else ()


def with_context(nothing: Report, around: Context) -> Report:
    """Add the checks and lines of sensing and vehicle to a report without a diagnosis of the driver.

    Args:
        nothing: the report.
        around: the other two blocks.
    """
    sensing, vehicle = around.sensing, around.vehicle
    return nothing._replace(
        checks=(*sensing.checks, *vehicle.checks),
        blocks=(
            sensing.block,
            vehicle.block,
            Blocked("driver", "not_testable", _body(nothing.says)),
            remnant_block.not_testable("Without a model of the driver there are no innovations.").block,
        ),
    )


def decided(findings: tuple[Finding, ...], lines: tuple[Blocked, ...]) -> Verdict:
    """Overall verdict: a cause that one block names counts, whatever another block leaves unexplained.

    The law of the noise is no cause of what the mean leaves: where only the remnant has findings, an unexplained block
    stays the verdict, and otherwise the mean law is adequate and the remnant is what is named.
    """
    named = [finding for finding in findings if not finding.surrogate]
    of_mean = [finding for finding in named if finding.where != remnant_block.WHERE]
    if not of_mean and any(line.state == "unexplained" for line in lines):
        return Verdict.UNEXPLAINED
    if named:
        return Verdict.ONE_OF if any(finding.rivals for finding in of_mean or named) else Verdict.NAMED
    return Verdict.ADEQUATE


def sentence(
    verdict: Verdict, findings: tuple[Finding, ...], lines: tuple[Blocked, ...], driver: Report, tried: int
) -> str:
    """Verdict line: block, cause, and gain."""
    left = " ".join(
        f"Something is left in the {line.where}: {line.says}" for line in lines if line.state == "unexplained"
    )
    noise = lines[-1]
    law = (
        f" The remnant: {noise.says}" if noise.where == remnant_block.WHERE and noise.state == "wrong" else ""
    )
    if verdict is Verdict.UNEXPLAINED:
        return f"UNEXPLAINED: {left}{law}"
    if verdict is Verdict.ADEQUATE:
        states = ", ".join(f"{line.where} {line.state.replace('_', ' ')}" for line in lines)
        return (
            f"ADEQUATE: none of {tried} causes explains more than chance, "
            f"and the residual holds nothing of the inputs ({states})."
        )
    if not any(finding.where != remnant_block.WHERE and not finding.surrogate for finding in findings):
        chosen = [_choice(finding) for finding in findings if finding.where == remnant_block.WHERE]
        either = f" ({', '.join(chosen)})" if verdict is Verdict.ONE_OF else ""
        word = "ONE OF" if verdict is Verdict.ONE_OF else "CAUSE"
        return f"{word}: Mean law adequate. The remnant{either}: {noise.says}"
    parts = []
    for where in BLOCKS:
        here = [finding for finding in findings if finding.where == where and not finding.surrogate]
        if not here:
            continue
        if verdict is Verdict.ONE_OF:
            parts.append(f"in the {where} " + " and ".join(map(_choice, here)))
        else:
            causes = " ".join(
                finding.says + (_better(finding.gain) if where != "driver" else "") for finding in here
            )
            parts.append(f"In the {where}: {causes}")
    better = gained(driver) if any(f.where == "driver" and not f.surrogate for f in findings) else ""
    tail = f" {left}" if left else ""
    if verdict is Verdict.ONE_OF:
        return f"ONE OF: {'; '.join(parts)}.{better}{tail}{law}"
    passed = "" if left else " The residual holds nothing more."
    return f"CAUSE: {' '.join(parts)}{better}{passed}{tail}{law}"


def gained(driver: Report, *, predicted: bool = True) -> str:
    """What the driver's findings gain: of the simulation, next to what the null gives, and of the log score.

    Args:
        driver: the driver's part of the report.
        predicted: the gain's interval is where that of another drive lies, behind another lead.
    """
    null, gain = driver.null_gain, driver.gain
    better = (
        _better(gain, " on held-out data; expected behind another lead", "") if predicted else _better(gain)
    )
    if better and null.replicates:
        without = f"{-100 * null.median:+.0f} %, 95 % point {-100 * null.high:+.0f} %"
        beyond = gain.value > null.high
        better = better[:-1] + (
            f" (without the cause, by the driver's own noise in the loop: {without})."
            if beyond
            else f", no more than without the cause, by the driver's own noise in the loop ({without})."
        )
    if driver.log_score_gain.value == driver.log_score_gain.value:
        better += f" One-step predictions: {remnant_block.gained_by(driver.log_score_gain)}."
    return better


def _better(gain: Interval, between: str = "", after: str = " on held-out data") -> str:
    """A gain, what is said before its interval, and after."""
    if gain.value != gain.value:
        return ""
    change, low, high = -100 * gain.value, -100 * gain.high, -100 * gain.low
    return f" Error variance {change:+.0f} %{between} [{low:+.0f}, {high:+.0f}]{after}."


def _choice(finding: Finding) -> str:
    if not finding.rivals:
        return finding.effect
    return "one of {" + ", ".join((finding.effect, *finding.rivals)) + "}"


def _body(says: str) -> str:
    """A block's line without the verdict's word before it."""
    head, colon, rest = says.partition(": ")
    return rest[:1].upper() + rest[1:] if colon and head.isupper() else says
