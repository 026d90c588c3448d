"""Overall report of driver, vehicle and sensing: the verdict, and the block in which a cause sits."""

from __future__ import annotations

from canid.diagnosis.corrections import Context
from canid.findings import Blocked, Finding, Report, Verdict
from canid.types import Interval

# in the order of the control loop, in which they are diagnosed as well
BLOCKS = ("sensing", "vehicle", "driver")


def join(driver: Report, around: Context) -> Report:
    """Join the driver's report with those of sensing and vehicle.

    Args:
        driver: the report of the driver's block alone.
        around: the other two.
    """
    sensing, vehicle = around.sensing, around.vehicle
    own = driver.findings
    if sensing.block.state == "unexplained":
        # the inputs of the driver are uncertain, and so is every cause that was found from them
        own = tuple(finding._replace(surrogate=True) for finding in own)
    findings = (*sensing.findings, *vehicle.findings, *own)
    block = driver.blocks[0]
    lines = (sensing.block, vehicle.block, block._replace(says=_body(block.says)))
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


def with_context(nothing: Report, around: Context) -> Report:
    """Add the checks and lines of sensing and vehicle to a report without a diagnosis of the driver.

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
    """Overall verdict: a cause that one block names counts, whatever another block leaves unexplained."""
    named = [finding for finding in findings if not finding.surrogate]
    if named:
        return Verdict.ONE_OF if any(finding.rivals for finding in named) else Verdict.NAMED
    if any(line.state == "unexplained" for line in lines):
        return Verdict.UNEXPLAINED
    return Verdict.ADEQUATE


def sentence(
    verdict: Verdict, findings: tuple[Finding, ...], lines: tuple[Blocked, ...], driver: Report, tried: int
) -> str:
    """Verdict line: block, cause, and gain."""
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
            causes = " ".join(
                finding.says + (_better(finding.gain) if where != "driver" else "") for finding in here
            )
            parts.append(f"In the {where}: {causes}")
    better = _better(driver.gain) if any(f.where == "driver" and not f.surrogate for f in findings) else ""
    tail = f" {left}" if left else ""
    if verdict is Verdict.ONE_OF:
        return f"ONE OF: {'; '.join(parts)}.{better}{tail}"
    passed = "" if left else " The residual holds nothing more."
    return f"CAUSE: {' '.join(parts)}{better}{passed}{tail}"


def _better(gain: Interval) -> str:
    if gain.value != gain.value:
        return ""
    change, low, high = -100 * gain.value, -100 * gain.high, -100 * gain.low
    return f" Error variance {change:+.0f} % [{low:+.0f}, {high:+.0f}] on held-out data."


def _choice(finding: Finding) -> str:
    if not finding.rivals:
        return finding.effect
    return "one of {" + ", ".join((finding.effect, *finding.rivals)) + "}"


def _body(says: str) -> str:
    """A block's line without the verdict's word before it."""
    head, colon, rest = says.partition(": ")
    return rest[:1].upper() + rest[1:] if colon and head.isupper() else says
