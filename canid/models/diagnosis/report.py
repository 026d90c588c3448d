"""Report of a diagnosis: the only place that puts one together, of either task."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.models.diagnosis import residual_maps, verdict
from canid.models.diagnosis.adequacy.adequacy import Adequacy
from canid.models.diagnosis.corrections import Corrected, TooLittleError
from canid.models.diagnosis.fitting.candidates import rival_causes
from canid.models.diagnosis.fitting.fitted_model import FittedModel, M
from canid.models.diagnosis.fitting.model import Columns
from canid.models.diagnosis.fitting.search import Named, Step
from canid.models.diagnosis.remnant import remnant_block
from canid.models.diagnosis.remnant.remnant_block import RemnantReport
from canid.models.diagnosis.verdict import Gained
from canid.models.effects.effect import Effect
from canid.values.findings import (
    Blocked,
    Check,
    DriveShare,
    Finding,
    Fit,
    Flags,
    NotTestable,
    Report,
    Rival,
    Trajectory,
    Tried,
    Verdict,
    Visible,
    Window,
    no_fit,
)
from canid.values.identified_model import IdentifiedModel
from canid.values.output_role import output_role
from canid.values.text.names import readable
from canid.values.text.numbers import chance, interval
from canid.values.types import NAN, Array, Interval, Trace

Signal = tuple[str, Array]  # role, (n,)


class Assessed(NamedTuple):
    """What was found in the driver's block and how it stands: all that a report says, before it is worded."""

    corrected: Corrected
    trace: Trace  # on the grid of the fits
    used: Flags  # (n,) samples that the fits rest on
    baseline: Fit
    extended: Fit
    simulated: tuple[Array, Array]  # (n,) by both models, before a pedal's floor
    findings: tuple[Finding, ...]  # of the driver, and of the record of the output
    held: Adequacy
    gained: Gained
    candidates: int  # causes that might have been named
    searched: Sequence[Step]
    expected: Mapping[str, float]  # effect id -> evidence of a typical strength
    undecided: Sequence[NotTestable]
    advice: Sequence[str]
    steps: Sequence[str]
    remarks: Sequence[str]  # on the driver's block
    maps: Sequence[tuple[Signal, Signal]]  # signals over which the residual is shown
    inputs: Mapping[str, Array]  # of the residual's coherence
    remnant: RemnantReport
    refused: str = ""  # why the baseline does not describe the drive; "": it does
    raw: Fit | None = None  # the driver before the signals were corrected; None: nothing was
    visible: tuple[Visible, ...] = ()
    closed_loop: tuple[Trajectory, ...] = ()
    model: IdentifiedModel | None = None
    drives: tuple[DriveShare, ...] = ()
    differ: tuple[str, ...] = ()
    rivals: tuple[Rival, ...] = ()
    recommended: str = ""


def report(tested: Assessed) -> Report:
    """Word what was found, and put the report together.

    Args:
        tested: the driver's block of either task, and the blocks around it.
    """
    context, trace, used, held = tested.corrected.context, tested.trace, tested.used, tested.held
    sensing, vehicle, remnant = context.sensing, context.vehicle, tested.remnant
    r0, r1 = (np.where(used, trace.output - out, 0.0) for out in tested.simulated)
    worst = residual_maps.worst(trace.t, r0, r1, used, trace.dt)
    block = _driver_block(tested, worst)
    findings = all_findings(tested)
    lines = _lines(tested.corrected, block, remnant.block)
    lines = tuple(_with_recorded(line, tested) for line in lines)
    of_all = verdict.decided(findings, lines, vehicle.missed)
    candidates = tested.candidates + sensing.tried
    candidates += len({t.effect for t in (*vehicle.tried, *remnant.tried)})
    named = frozenset(finding.effect for finding in findings)
    undecided = (*tested.undecided, *sensing.not_testable, *vehicle.not_testable)
    alone = _driver_says(tested, worst)
    # the share is that of the driver's residual: of another block's nothing is known
    share = verdict.unexplained(held) if not tested.refused else Interval()
    known = of_all is not Verdict.UNEXPLAINED or block.state == "unexplained"
    before = tested.raw or (tested.baseline if tested.findings else None)
    return Report(
        verdict=of_all,
        says=verdict.sentence(of_all, findings, lines, tested.gained, candidates) if context.whole else alone,
        output=output_role(trace),
        t=trace.t,
        measured=trace.output,
        used=used,
        baseline=tested.baseline,
        extended=tested.extended,
        findings=findings,
        unexplained=share if known else Interval(),
        gain=tested.gained.gain,
        not_testable=tuple(entry for line in undecided for entry in verdict.still_undecided(line, named)),
        candidates_tried=candidates,
        tried=(*_tried(tested), *vehicle.tried, *remnant.tried),
        checks=(*sensing.checks, *vehicle.checks, *_adequacy_checks(held)),
        masked=tested.corrected.masked,
        blocks=lines,
        worst=worst,
        maps=tuple(residual_maps.operating_map(x, y, r0, r1, used, trace.dt) for x, y in tested.maps),
        spectra=residual_maps.spectra(r0, r1, tested.inputs, used, trace.dt),
        closed_loop=tested.closed_loop,
        shifts=_shifts(before, tested.extended) if before is not None else {},
        advice=(tested.refused,) if tested.refused else tuple(dict.fromkeys(tested.advice)),
        steps=(*context.steps, *tested.steps, *_refused_step(tested), *remnant.steps),
        rivals=tested.rivals,
        recommended=tested.recommended,
        model=tested.model,
        log_score_gain=tested.gained.log_score,
        null_gain=tested.gained.null,
        drives=tested.drives,
        differ=tested.differ,
        visible=tested.visible,
    )


def nothing(corrected: Corrected, missing: TooLittleError) -> Report:
    """Report of a drive that is too short or too quiet for a diagnosis of its driver."""
    trace, context = corrected.trace, corrected.context
    n = trace.t.size
    says = f"NOT ENOUGH DATA: {missing.why}"
    block = Blocked("driver", "not_testable", says if context.whole else missing.why)
    remnant = remnant_block.not_testable("Without a model of the driver there are no innovations.")
    return Report(
        verdict=Verdict.NOT_ENOUGH_DATA, says=says, output=output_role(trace), t=trace.t,
        measured=trace.output, used=np.zeros(n, dtype=bool), baseline=no_fit(n), extended=no_fit(n), findings=(),
        unexplained=Interval(), gain=Interval(), not_testable=(), candidates_tried=0, tried=(),
        checks=(*context.sensing.checks, *context.vehicle.checks), masked=corrected.masked,
        blocks=_lines(corrected, block, context.remnant or remnant.block), worst=(), maps=(), spectra=None,
        closed_loop=(), shifts={}, advice=(missing.why,), steps=(*missing.steps, "stopped: not enough data"),
    )  # fmt: skip


def all_findings(tested: Assessed) -> tuple[Finding, ...]:
    """Findings of all blocks, in the order of the loop."""
    sensing, vehicle, of_driver = (
        tested.corrected.context.sensing,
        tested.corrected.context.vehicle,
        tested.findings,
    )
    if sensing.block.state == "unexplained":
        # the inputs of the driver are uncertain, and so is every cause that was found from them
        of_driver = tuple(finding._replace(surrogate=True) for finding in of_driver)
    recorded = tuple(finding for finding in of_driver if finding.where == "sensing")
    of_driver = tuple(finding for finding in of_driver if finding.where != "sensing")
    return (*sensing.findings, *recorded, *vehicle.findings, *of_driver, *tested.remnant.findings)


def finding(
    cause: Named,
    estimates: Mapping[str, Interval],
    held: Adequacy,
    gained: Gained,
    log_score: Interval,
    parameters: Callable[[FittedModel[Any], Effect], Mapping[str, Interval]],
    in_unit: Callable[[str], str] = str,
) -> Finding:
    """A cause of the driver as a report has it.

    Args:
        cause: as it was accepted.
        estimates: parameter -> interval.
        held: adequacy tests of the last model; where one failed, it is not the cause.
        gained: by all findings of the driver.
        log_score: nats/min, gained by this one.
        parameters: of a rival's model, as `rival_causes` takes it.
        in_unit: puts the output's unit into a text.
    """
    says = in_unit(cause.effect.says)
    for name, iv in estimates.items():
        says = says.replace("{" + name + "}", interval(iv))
    return Finding(
        effect=cause.effect.id, where=cause.effect.where, rivals=cause.rivals, surrogate=not held.passed,
        parameters=estimates, units={p.name: in_unit(p.unit) for p in cause.effect.parameters}, gain=gained.gain, says=says,
        evidence=cause.evidence, needed=cause.needed, episodes=cause.episodes, log_score_gain=log_score,
        null_gain=gained.null, rival_causes=rival_causes(cause, parameters, in_unit),
    )  # fmt: skip


def explained(before: FittedModel[M], after: FittedModel[M], data: Columns) -> float:
    """Variance that the causes took from the residual, over what they left, on the samples that both models count.

    Args:
        before: the baseline.
        after: the model with the causes.
        data: what both explain.
    """
    rows, y = before.rows & after.rows, data.output.y
    left, whole = (float(np.var((y - fitted.fitted.model)[rows])) for fitted in (after, before))
    return max(whole / max(left, 1e-12) - 1, 0.0)


def fit_quality(y: Array, out: Array, used: Flags) -> tuple[float, float]:
    """How well a simulation fits: 100 (1 − |y − simulated| / |y − mean|), and the standard deviation of what it leaves.

    Example:
        >>> fit_quality(np.array([1.0, 3.0]), np.array([1.0, 3.0]), np.array([True, True]))
        (100.0, 0.0)
    """
    left, y = (y - out)[used], y[used]
    variation = float(np.linalg.norm(y - y.mean()))
    percent = 100 * (1 - float(np.linalg.norm(left)) / variation) if variation > 0 else NAN
    return percent, float(np.std(left))


def search_steps(
    held: Adequacy, named: Sequence[Named], searched: Sequence[Step], candidates: int, rows: int, order: int
) -> list[str]:
    """What the search did, line by line.

    Args:
        held: adequacy tests of the last model.
        named: what was accepted.
        searched: every candidate of every step.
        candidates: causes that might have been named.
        rows: samples that the baseline was fitted to.
        order: of its autoregressive noise.
    """
    left = "; ".join(verdict.failed(held))
    return [
        f"baseline fitted on {rows} samples; noise autoregressive of order {order}",
        *(
            f"{readable(cause.effect.id)} accepted: evidence {cause.evidence:.0f}, needed {cause.needed:.0f}"
            for cause in named
        ),
        f"{len({s.effect.id for s in searched})} causes fitted in full, of the {candidates} of this block",
        "residual adequate" if held.passed else f"residual not adequate: {left}",
    ]


def _of_driver(tested: Assessed) -> tuple[Finding, ...]:
    """Findings of the driver's block, but those on what was recorded of the driver."""
    return tuple(finding for finding in tested.findings if finding.where == "driver")


def _driver_says(tested: Assessed, worst: tuple[Window, ...]) -> str:
    """Verdict line of the driver's block."""
    if tested.refused:
        return f"UNEXPLAINED: the baseline does not describe this drive: {tested.refused}."
    return verdict.says(_of_driver(tested), tested.held, worst, tested.gained, tested.candidates)


def _driver_block(tested: Assessed, worst: tuple[Window, ...]) -> Blocked:
    says = _driver_says(tested, worst)
    if tested.refused:
        return Blocked("driver", "unexplained", says)
    of_driver = verdict.of_driver(_of_driver(tested), tested.held.passed)
    return Blocked(
        "driver", verdict.state(of_driver), says + "".join(f" {remark}." for remark in tested.remarks)
    )


def _refused_step(tested: Assessed) -> tuple[str, ...]:
    return (f"baseline refused: {tested.refused}",) if tested.refused else ()


def _lines(corrected: Corrected, driver: Blocked, remnant: Blocked) -> tuple[Blocked, ...]:
    """Result of each block, in the order of the loop."""
    context = corrected.context
    if context.whole:
        driver = driver._replace(says=verdict.body(driver.says))
    return context.sensing.block, context.vehicle.block, driver, remnant


def _with_recorded(line: Blocked, tested: Assessed) -> Blocked:
    """The sensors' line with what the driver's block found in them."""
    says = " ".join(finding.says for finding in tested.findings if finding.where == "sensing")
    if line.where != "sensing" or not says:
        return line
    before = f"{line.says} " if line.state != "adequate" else ""
    return line._replace(state="unexplained" if line.state == "unexplained" else "wrong", says=before + says)


def _tried(tested: Assessed) -> tuple[Tried, ...]:
    """Every step of the search, with its outcome and the evidence that a typical strength would have."""
    rivals = {rival for cause in tested.findings for rival in cause.rivals}
    return tuple(
        Tried(
            s.effect.id, s.effect.where, s.step, s.evidence, s.needed, tested.expected.get(s.effect.id, NAN),
            "accepted" if s.accepted else "rival" if s.effect.id in rivals else "rejected",
            "" if s.accepted else "another one explained more" if s.evidence > s.needed else "chance explains as much",
        )
        for s in tested.searched
    )  # fmt: skip


def _adequacy_checks(held: Adequacy) -> tuple[Check, ...]:
    """One check per family."""
    return tuple(
        Check(f.name, f not in held.failed, f.p, held.bound,
              f"{f.says}: chance {chance(f.p)} over {f.dimensions} directions, "
              f"{100 * f.share:.1f} % of the residual's variance",
              gate=True)
        for f in held.families
    )  # fmt: skip


def _shifts(before: Fit, after: Fit) -> dict[str, tuple[Interval, Interval]]:
    """Parameters of the driver before and after the extension."""
    pairs = [(name, before.channels[name], channel) for name, channel in after.channels.items()]
    return {
        f"{name} {what}": (getattr(first, what), getattr(channel, what))
        for name, first, channel in pairs
        for what in ("K", "tau", "dead_time", "tau_plus_dead_time")
    }
