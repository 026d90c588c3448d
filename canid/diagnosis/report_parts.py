"""Parts of a report that both tasks share: what was tried, the checks, the verdict and its sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.diagnosis import masks, overall_verdict
from canid.diagnosis.adequacy.adequacy import Adequacy
from canid.diagnosis.driver import pedal_holds
from canid.diagnosis.fitting.search import Named, Step
from canid.effects.effect import Detector
from canid.findings import Check, Finding, Fit, Masked, Report, Tried, Verdict, no_fit
from canid.identification.confidence import SIGMAS
from canid.types import NAN, Interval, Trace


def tried(
    steps: Sequence[Step], findings: tuple[Finding, ...], expected: dict[str, float]
) -> tuple[Tried, ...]:
    """Every step of the search, with its outcome and the evidence that a typical strength would have."""
    rivals = {rival for finding in findings for rival in finding.rivals}
    return tuple(
        Tried(
            s.effect.id, s.effect.where, s.step, s.evidence, s.needed, expected.get(s.effect.id, NAN),
            "accepted" if s.accepted else "rival" if s.effect.id in rivals else "rejected",
            "" if s.accepted else "another one explained more" if s.evidence > s.needed else "chance explains as much",
        )
        for s in steps
    )  # fmt: skip


def verdict(findings: tuple[Finding, ...], passed: bool) -> Verdict:
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
    return [f"{f.says} (p {f.p:.1g}, {100 * f.share:.0f} % of the residual)" for f in held.failed]


def says(report: Report, held: Adequacy, tried: int, *, predicted: bool = True) -> str:
    """Verdict line of the driver's block alone; `predicted` as of `overall_verdict.gained`."""
    verdict, findings, worst = report.verdict, report.findings, report.worst
    better = overall_verdict.gained(report, predicted=predicted)
    if verdict is Verdict.ADEQUATE:
        return (
            f"ADEQUATE: none of {tried} causes explains more than chance, "
            "and the residual holds nothing of the inputs."
        )
    if verdict is Verdict.UNEXPLAINED:
        what = "; ".join(failed(held))
        names = ", ".join(finding.effect for finding in findings)
        helps = "helps, but" if report.gain.value > 0 else "predicts the next sample better, but"
        surrogate = f" {names} {helps} is not the cause." if findings else ""
        where = max(worst, key=lambda one: one.after, default=None)
        most = f" Most of it is at {where.start:.0f} to {where.stop:.0f} s." if where is not None else ""
        return f"UNEXPLAINED: the residual holds {what}.{most}{surrogate}{better}"
    if verdict is Verdict.ONE_OF:
        sets = " and ".join("one of {" + ", ".join((f.effect, *f.rivals)) + "}" for f in findings)
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


def adequacy_checks(held: Adequacy) -> tuple[Check, ...]:
    """One check per family."""
    return tuple(
        Check(f.name, f not in held.failed, f.p, held.bound,
              f"{f.says}: chance {f.p:.2g} over {f.dimensions} directions, {100 * f.share:.1f} % of the residual's variance",
              gate=True)
        for f in held.families
    )  # fmt: skip


def shifts(before: Fit, after: Fit) -> dict[str, tuple[Interval, Interval]]:
    """Parameters of the driver before and after the extension."""
    out = {}
    for name, channel in after.channels.items():
        first = before.channels[name]
        for what in ("K", "tau", "dead_time", "tau_plus_dead_time"):
            out[f"{name} {what}"] = (getattr(first, what), getattr(channel, what))
    return out


def step(one: Named) -> str:
    """What the search did, as a line."""
    return f"{one.effect.id} accepted: evidence {one.evidence:.0f}, needed {one.needed:.0f}"


def episode_parameters(one: Named, seconds: float) -> dict[str, Interval]:
    """How often and how long, or at what interval, from the episodes themselves."""
    lengths = np.array([stop - start for start, stop in one.episodes])
    n = len(lengths)
    names = [parameter.name for parameter in one.effect.parameters]
    if Detector.PEDAL_RHYTHM in one.effect.detectors:
        # half a step of the frequency grid to either side
        half = 0.5 * pedal_holds.RHYTHM_STEP_HZ * one.level**2
        return {names[0]: Interval(one.level, one.level - half, one.level + half)}
    rate = 60 * n / seconds
    # the standard deviation of a count is its square root; that of a mean is its values' over the root of their number
    wide = SIGMAS * rate / np.sqrt(n)
    mean, sd = float(lengths.mean()), float(lengths.std(ddof=1) / np.sqrt(n)) if n > 1 else NAN
    return {
        names[0]: Interval(rate, max(rate - wide, 0.0), rate + wide),
        names[1]: Interval(mean, mean - SIGMAS * sd, mean + SIGMAS * sd),
    }


def nothing(trace: Trace, why: str, masked: tuple[Masked, ...], steps: list[str]) -> Report:
    """Report of a drive that is too short or too quiet for a diagnosis."""
    n = trace.t.size
    return Report(
        verdict=Verdict.NOT_ENOUGH_DATA, says=f"NOT ENOUGH DATA: {why}", output=masks.output_role(trace), t=trace.t,
        measured=trace.output, used=np.zeros(n, dtype=bool), baseline=no_fit(n), extended=no_fit(n), findings=(),
        unexplained=Interval(), gain=Interval(), not_testable=(), candidates_tried=0, tried=(), checks=(),
        masked=masked, blocks=(), worst=(), maps=(), spectra=None, closed_loop=(), shifts={}, advice=(why,),
        steps=(*steps, "stopped: not enough data"),
    )  # fmt: skip
