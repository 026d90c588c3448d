"""One report of the driver, his car and his sensors: the verdict of the whole, and in which block a cause sits."""

from __future__ import annotations

from canid.diagnosis.around import Around
from canid.findings import Blocked, Finding, Report, Verdict
from canid.types import Interval

# as the loop goes, and as they are looked at
BLOCKS = ("sensing", "vehicle", "driver")


def join(driver: Report, around: Around) -> Report:
    """Add to the driver's report what is around him.

    Args:
        driver: the report of the driver's block alone.
        around: the other two.
    """
    sensing, vehicle = around.sensing, around.vehicle
    own = driver.findings
    if sensing.block.state == "unexplained":
        # what the driver saw is in doubt, and with it every name that rests on it
        own = tuple(finding._replace(surrogate=True) for finding in own)
    findings = (*sensing.findings, *vehicle.findings, *own)
    told = driver.blocks[0]
    lines = (sensing.block, vehicle.block, told._replace(says=_body(told.says)))
    verdict = decided(findings, lines)
    tried = driver.candidates_tried + sensing.tried + len({t.effect for t in vehicle.tried})
    return driver._replace(
        verdict=verdict,
        says=sentence(verdict, findings, lines, driver, tried),
        findings=findings,
        not_testable=(*driver.not_testable, *sensing.not_testable, *vehicle.not_testable),
        candidates_tried=tried,
        tried=(*driver.tried, *vehicle.tried),
        checks=(*sensing.checks, *vehicle.checks, *driver.checks),
        blocks=lines,
        steps=(*around.steps, *driver.steps),
    )


def beside(nothing: Report, around: Around) -> Report:
    """Add to a report that says nothing of the driver which blocks could be looked at; it names nothing.

    Args:
        nothing: the report.
        around: the other two blocks.
    """
    sensing, vehicle = around.sensing, around.vehicle
    return nothing._replace(
        checks=(*sensing.checks, *vehicle.checks),
        blocks=(sensing.block, vehicle.block, Blocked("driver", "not_testable", _body(nothing.says))),
    )


def decided(findings: tuple[Finding, ...], lines: tuple[Blocked, ...]) -> Verdict:
    """Decide: a block that has its cause is told, whatever is left in another one."""
    named = [finding for finding in findings if not finding.surrogate]
    if named:
        return Verdict.ONE_OF if any(finding.rivals for finding in named) else Verdict.NAMED
    if any(line.state == "unexplained" for line in lines):
        return Verdict.UNEXPLAINED
    return Verdict.ADEQUATE


def sentence(
    verdict: Verdict, findings: tuple[Finding, ...], lines: tuple[Blocked, ...], driver: Report, tried: int
) -> str:
    """Write the verdict line: in which block, what, and what it gains."""
    left = " ".join(
        f"Something is left in the {line.where}: {line.says}" for line in lines if line.state == "unexplained"
    )
    if verdict is Verdict.UNEXPLAINED:
        return f"UNEXPLAINED: {left}"
    if verdict is Verdict.ADEQUATE:
        states = ", ".join(f"{line.where} {line.state.replace('_', ' ')}" for line in lines)
        return (
            f"ADEQUATE: none of {tried} causes explains more than chance, "
            f"and the residual holds nothing of the inputs ({states})."
        )
    parts = []
    for where in BLOCKS:
        here = [finding for finding in findings if finding.where == where and not finding.surrogate]
        if not here:
            continue
        if verdict is Verdict.ONE_OF:
            parts.append(f"in the {where} " + " and ".join(map(_choice, here)))
        else:
            told = " ".join(
                finding.says + (_better(finding.gain) if where != "driver" else "") for finding in here
            )
            parts.append(f"In the {where}: {told}")
    better = _better(driver.gain) if any(f.where == "driver" and not f.surrogate for f in findings) else ""
    tail = f" {left}" if left else ""
    if verdict is Verdict.ONE_OF:
        return f"ONE OF: {'; '.join(parts)}.{better}{tail}"
    passed = "" if left else " The gate is passed."
    return f"CAUSE: {' '.join(parts)}{better}{passed}{tail}"


def _better(gain: Interval) -> str:
    if gain.value != gain.value:
        return ""
    change, low, high = -100 * gain.value, -100 * gain.high, -100 * gain.low
    return f" Error variance {change:+.0f} % [{low:+.0f}, {high:+.0f}] on data that did not fit it."


def _choice(finding: Finding) -> str:
    if not finding.rivals:
        return finding.effect
    return "one of {" + ", ".join((finding.effect, *finding.rivals)) + "}"


def _body(says: str) -> str:
    """A block's line without the verdict's word before it."""
    head, colon, rest = says.partition(": ")
    return rest[:1].upper() + rest[1:] if colon and head.isupper() else says
