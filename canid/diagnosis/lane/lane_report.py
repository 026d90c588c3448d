"""Diagnosis of a lane drive: the report of car following, with the driver's block alone."""

from __future__ import annotations

from collections.abc import Callable
from zlib import crc32

import numpy as np

from canid.diagnosis import masks, report_parts, residual_maps, signal_findings
from canid.diagnosis.adequacy.adequacy import Adequacy
from canid.diagnosis.lane import (
    lane_adequacy,
    lane_check,
    lane_confirmed,
    lane_detectability,
    lane_fit,
    lane_held_out,
    lane_intervals,
)
from canid.diagnosis.lane.lane_confirmed import Confirmed
from canid.diagnosis.lane.lane_data import LaneData, prepare
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.diagnosis.lane.lane_search import Search
from canid.effects.effect import Effect
from canid.findings import Blocked, Finding, Fit, Masked, Report, Verdict
from canid.types import NAN, Array, Interval, Trace

# m/s; standard deviation of a speed that has no axis of its own in a map
STEADY_SPEED = 0.5
NO_ANSWER = (
    "the wheel answers the lateral offset by no more than chance: is it the right signal, and does a person steer? "
    "If so, drive longer"
)
# blocks that car following has as well
OTHERS = (
    Blocked("sensing", "not_testable", "Nothing is redundant with a lateral offset."),
    Blocked("vehicle", "not_testable", "How the car answers the wheel is not diagnosed."),
)
REMNANT = Blocked("remnant", "not_testable", "The noise of a driver who keeps the lane is not diagnosed.")


def diagnose(
    trace: Trace, catalogue: tuple[Effect, ...], minimum: float, progress: Callable[[float], None]
) -> Report:
    """Diagnose a lane drive.

    Args:
        trace: of the task lane keeping.
        catalogue: the effects that may be named.
        minimum: s of steering that must be there.
        progress: is given the fraction of the replicates that is done.
    """
    wrong = signal_findings.untrusted(trace, ())
    usable, masked = signal_findings.mask(trace, wrong)
    steps = [f"{trace.t.size} samples at {trace.dt:g} s"]
    missing = signal_findings.lacking(wrong, usable, minimum, trace.dt)
    missing = missing or lane_check.lacking(trace, usable, minimum)
    if missing:
        return _nothing(trace, missing, masked, steps)
    data = prepare(trace, usable)
    fitted = lane_fit.baseline(data)
    if fitted is None:
        return _nothing(trace, "too few samples in a row in which a person keeps the lane", masked, steps)
    if not lane_fit.answered(data, fitted):
        return _nothing(trace, NO_ANSWER, masked, steps)
    # the same drive gives the same replicates
    seed = crc32(np.ascontiguousarray(trace.output).tobytes())
    found = lane_confirmed.search_causes(data, catalogue, fitted, seed, progress)
    # curves turn the wheel more than an offset does: with a cause that explains them the model may hold
    refused = lane_check.refusal(found.search.data, found.search.solved)
    if not refused:
        return _report(trace, data, found, catalogue, masked, steps)
    nothing = lane_confirmed.search_causes(data, (), fitted, seed, progress)
    report = _report(trace, data, nothing, (), masked, steps)
    says = f"UNEXPLAINED: the baseline does not describe this drive: {refused}."
    return report._replace(
        verdict=Verdict.UNEXPLAINED,
        says=says,
        unexplained=Interval(),
        blocks=(*OTHERS, Blocked("driver", "unexplained", says), REMNANT),
        advice=(refused,),
        steps=(*report.steps, f"baseline refused: {refused}"),
    )


def _nothing(trace: Trace, why: str, masked: tuple[Masked, ...], steps: list[str]) -> Report:
    report = report_parts.nothing(trace, why, masked, steps)
    return report._replace(blocks=(*OTHERS, Blocked("driver", "not_testable", why), REMNANT))


def _report(
    trace: Trace,
    data: LaneData,
    found: Confirmed,
    catalogue: tuple[Effect, ...],
    masked: tuple[Masked, ...],
    steps: list[str],
) -> Report:
    search = found.search
    before, solved, dt, used = search.baseline, search.solved, trace.dt, data.output.usable
    episodes = search.holds.episodes if search.holds is not None else ()
    after_out = lane_held_out.held(solved.fitted.model, episodes)
    held = lane_adequacy.assess(search, _explained(data, search))
    base, extended = _fit(before, before.fitted.model, data), _fit(solved, after_out, data)
    findings = _findings(found, data, passed=held.passed)
    evidence = lane_detectability.expected(catalogue, data, before)
    undecided = lane_detectability.undecided(catalogue, evidence, {f.effect for f in findings})
    r0 = np.where(used, data.output.y - before.fitted.model, 0.0)
    r1 = np.where(used, data.output.y - after_out, 0.0)
    moves = float(np.std(data.speed[used])) > STEADY_SPEED
    axes = ("lateral_offset", data.offset), ("speed", data.speed)
    verdict = report_parts.verdict(findings, held.passed)
    report = Report(
        verdict=verdict, says="", output=masks.output_role(trace), t=trace.t, measured=trace.output, used=used,
        baseline=base, extended=extended, findings=findings, unexplained=report_parts.unexplained(held), gain=found.gain,
        not_testable=tuple(undecided), candidates_tried=len(catalogue),
        tried=report_parts.tried(search.steps, findings, evidence), checks=report_parts.adequacy_checks(held),
        masked=masked, blocks=(), worst=residual_maps.worst(trace.t, r0, r1, used, dt),
        maps=(residual_maps.operating_map(*axes, r0, r1, used, dt),) if moves else (),
        spectra=residual_maps.spectra(r0, r1, {"lateral_offset": data.offset}, used, dt),
        closed_loop=(), shifts=report_parts.shifts(base, extended) if findings else {},
        advice=tuple(dict.fromkeys(one.why.rpartition("what would decide: ")[2] for one in undecided)),
        steps=(*steps, *_steps(found, held, catalogue)), log_score_gain=found.log_score, null_gain=found.null_gain,
    )  # fmt: skip
    # the interval of a lane keeper's gain is that of a bootstrap on this drive
    says = report_parts.says(report, held, len(catalogue), predicted=False)
    withdrawn = "".join(f" {one}." for one in found.refused)
    block = Blocked("driver", report_parts.state(verdict), says + withdrawn)
    return report._replace(says=says, blocks=(*OTHERS, block, REMNANT))


def _findings(found: Confirmed, data: LaneData, *, passed: bool) -> tuple[Finding, ...]:
    search = found.search
    fitted = lane_intervals.parameters(search.solved, search.data)
    out = []
    for one in search.named:
        estimates = fitted.get(one.effect.id, {})
        if one.episodes:
            estimates = report_parts.episode_parameters(one, float(data.output.usable.sum()) * data.output.dt)
        says = one.effect.says
        for name, iv in estimates.items():
            says = says.replace("{" + name + "}", f"{iv.value:.3g} [{iv.low:.3g}, {iv.high:.3g}]")
        out.append(Finding(
            effect=one.effect.id, where=one.effect.where, rivals=one.rivals, surrogate=not passed,
            parameters=estimates, units={p.name: p.unit for p in one.effect.parameters}, gain=found.gain, says=says,
            evidence=one.evidence, needed=one.needed, episodes=one.episodes,
            log_score_gain=found.log_scores[one.effect.id], null_gain=found.null_gain,
        ))  # fmt: skip
    return tuple(out)


def _fit(solved: FittedLane, out: Array, data: LaneData) -> Fit:
    used, y = data.output.usable, data.output.y
    left = (y - out)[used]
    variation = float(np.linalg.norm(y[used] - y[used].mean()))
    percent = 100 * (1 - float(np.linalg.norm(left)) / variation) if variation > 0 else NAN
    return Fit(lane_intervals.channels(solved, data), percent, out, float(np.std(left)))


def _explained(data: LaneData, search: Search) -> float:
    """Variance that the causes took from the residual, over what they left, on the samples that both models count."""
    rows = search.baseline.rows & search.solved.rows
    before, after = (
        float(np.var((data.output.y - of.fitted.model)[rows])) for of in (search.baseline, search.solved)
    )
    return max(before / max(after, 1e-12) - 1, 0.0)


def _steps(found: Confirmed, held: Adequacy, catalogue: tuple[Effect, ...]) -> list[str]:
    search = found.search
    order = search.baseline.noise.A.size - 1
    return [
        *found.refused,
        f"baseline fitted on {int(search.baseline.rows.sum())} samples; noise autoregressive of order {order}",
        *(report_parts.step(one) for one in search.named),
        f"{len({s.effect.id for s in search.steps})} causes fitted in full, of {len(catalogue)} tried",
        "residual adequate"
        if held.passed
        else "residual not adequate: " + "; ".join(report_parts.failed(held)),
    ]
