"""Diagnosis of a drive: where the simulation is wrong, the cause, the extended model, and what it gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from canid.diagnosis import corrections, overall_verdict, report_parts, signal_findings
from canid.diagnosis.driver import (
    baseline_form,
    held_out,
    pedal_holds,
)
from canid.diagnosis.driver.driver_fit import answered
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.driver_report import (
    Null,
    baseline_refused,
    driver_report,
    fit_of,
    recorded_drive,
    refused_baseline,
)
from canid.diagnosis.final_model import final_model
from canid.diagnosis.lane import lane_report
from canid.diagnosis.null import confirmed_search
from canid.diagnosis.prepared_drive import Prepared, lacking, ready
from canid.diagnosis.remnant import remnant_block
from canid.diagnosis.remnant.innovations import innovations
from canid.diagnosis.remnant.remnant_block import RemnantReport
from canid.diagnosis.rivals import comparison
from canid.diagnosis.rivals.recommendation import recommended
from canid.diagnosis.several_drives import shared_car, shared_causes
from canid.diagnosis.several_drives.joined_drives import join
from canid.diagnosis.vehicle.vehicle_block import Vehicle
from canid.effects import CATALOGUE, LANE_CATALOGUE
from canid.effects.effect import Detector, Effect, Kind
from canid.effects.wanted_gap import Form
from canid.findings import (
    Report,
    masked_for,
)
from canid.identified_model import IdentifiedModel
from canid.signal_checks.drive_time import of_trace
from canid.types import TASK_INPUTS, Trace

# s of driving that a diagnosis needs: in less than two minutes no cause stands out from chance (evidence grows with time)
MIN_DRIVING_S = 90.0
NO_ANSWER = (
    "the output answers neither headway nor relative speed by more than chance: is it the right signal? "
    "If it is, drive longer behind a lead whose speed changes"
)


def diagnose(
    trace: Trace,
    *,
    catalogue: tuple[Effect, ...] | None = None,
    minimum: float = MIN_DRIVING_S,
    rivals: bool = False,
    progress: Callable[[float], None] = lambda _: None,
) -> Report:
    """Diagnose a drive: its sensors first, then the car, then the driver; of lane keeping, the driver alone.

    Args:
        trace: from `read_trace`.
        catalogue: the effects that may be named; None: those of the task.
        minimum: s of driving that must be there.
        rivals: calibrate published car-following models as well; some 2 s of CPU time per 10 min.
        progress: is given the fraction of the replicates that are done, where a finding is held against them.

    Returns:
        a `Report`. A drive that decides nothing gets a verdict as well, never an exception.

    Example:
        >>> import canid
        >>> report = canid.diagnose(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        >>> report.verdict.value
        'adequate'
    """
    if trace.input_names == TASK_INPUTS["lane_keeping"]:
        chosen = LANE_CATALOGUE if catalogue is None else catalogue
        report = lane_report.diagnose(trace, chosen, minimum, progress)
    else:
        chosen = CATALOGUE if catalogue is None else catalogue
        context = corrections.diagnose_context(trace, chosen)
        report = _diagnosed(trace, context, chosen, minimum, rivals, progress, Several())
    return report._replace(signals=trace.findings, time=of_trace(trace))


def diagnose_drives(
    traces: Sequence[Trace],
    names: Sequence[str],
    *,
    catalogue: tuple[Effect, ...] = CATALOGUE,
    minimum: float = MIN_DRIVING_S,
    rivals: bool = False,
    progress: Callable[[float], None] = lambda _: None,
) -> Report:
    """Diagnose several drives of one driver in one car together.

    Causes and parameters are those of all drives; each drive has an offset of its own. What was found is then held against
    each drive by a fit to the others, and what differs between the drives is said.

    Args:
        traces: from `read_trace`, with one vehicle file.
        names: of the drives.
        catalogue: the effects that may be named.
        minimum: s of driving that must be there, on all drives together.
        rivals: as in `diagnose`.
        progress: as in `diagnose`.

    Returns:
        One `Report`; `drives` and `differ` say what each drive makes of it.

    Raises:
        ConfigError: the drives differ in step, inputs, or output filter.
    """
    joined = join(traces)
    several = Several(joined.spans, tuple(names))
    context = corrections.diagnose_context(joined.trace, catalogue)
    report = _diagnosed(joined.trace, context, catalogue, minimum, rivals, progress, several)
    return report._replace(signals=joined.trace.findings, time=joined.time)


def diagnose_car(
    traces: Sequence[Trace],
    names: Sequence[str],
    *,
    catalogue: tuple[Effect, ...] = CATALOGUE,
    minimum: float = MIN_DRIVING_S,
    rivals: bool = False,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[Report, ...]:
    """Diagnose several drives of one car, whoever drove: sensors and car on all of them together, each driver by himself.

    Args:
        traces: from `read_trace`, with one vehicle file.
        names: of the drives.
        catalogue: the effects that may be named.
        minimum: s of driving that must be there, on each drive.
        rivals: as in `diagnose`.
        progress: as in `diagnose`, of each drive in turn.

    Returns:
        One `Report` of each drive. Their blocks of sensing and vehicle rest on all drives; `drives` says what the
        findings in the car gain on each drive by a fit to the others.

    Raises:
        ConfigError: the drives differ in step, inputs, or output filter.
    """
    joined = join(traces)
    car = shared_car.diagnose_car(joined, traces, names, catalogue)
    out = []
    for k, (trace, context) in enumerate(zip(traces, car.contexts, strict=True)):

        def part(done: float, k: int = k) -> None:
            progress((k + done) / len(traces))

        report = _diagnosed(trace, context, catalogue, minimum, rivals, part, Several())
        out.append(report._replace(signals=trace.findings, time=of_trace(trace), drives=car.drives))
    return tuple(out)


class Several(NamedTuple):
    """Drives on one trace."""

    spans: tuple[tuple[float, float], ...] = ()  # s, [begin, end) of each; (): it is one
    names: tuple[str, ...] = ()

    @property
    def begins(self) -> tuple[float, ...]:
        """Of each further drive, s."""
        return tuple(begin for begin, _ in self.spans[1:])


def _diagnosed(
    trace: Trace,
    context: corrections.Context,
    catalogue: tuple[Effect, ...],
    minimum: float,
    rivals: bool,
    progress: Callable[[float], None],
    several: Several,
) -> Report:
    given, trace, usable, masked = trace, context.trace, context.usable, context.masked
    wrong = signal_findings.untrusted(given, context.sensing.findings)
    sound, stretches = signal_findings.mask(given, wrong)
    usable, masked = usable & sound, tuple(sorted((*masked, *stretches), key=lambda one: one.start))
    steps = [f"{trace.t.size} samples at {trace.dt:g} s"]
    if masked:
        spans = (f"{effect} {seconds:.0f} s" for effect, seconds in masked_for(masked).items())
        steps.append(f"masked before any fit: {', '.join(spans)}")
    missing = signal_findings.lacking(wrong, sound, minimum, trace.dt) or lacking(
        trace, usable, masked, minimum
    )
    if missing:
        return overall_verdict.with_context(report_parts.nothing(trace, missing, masked, steps), context)
    prepared = ready(trace, usable, several.begins)
    if prepared is None:
        why = "too few samples in a row in which a person drives behind a lead"
        return overall_verdict.with_context(report_parts.nothing(trace, why, masked, steps), context)
    silent = not answered(prepared.data, prepared.fitted)
    # a pedal that stands at its ceiling most of the time still answers below it
    if silent and pedal_holds.detect(prepared.data, prepared.fitted).pattern is not Detector.PEDAL_CEILING:
        return overall_verdict.with_context(report_parts.nothing(trace, NO_ANSWER, masked, steps), context)
    if prepared.trace.dt > trace.dt * 1.5:
        steps.append(
            f"the output has no content above {0.5 / prepared.trace.dt:.2g} Hz: sampled every {prepared.trace.dt:.1f} s"
        )
    drivers = tuple(
        effect for effect in catalogue if effect.where == "driver" and effect.kind is not Kind.MASK
    )
    form = baseline_form.choose(prepared.trace, prepared.data, prepared.fitted, drivers)
    if form.fitted.model.form is not Form.TIME_HEADWAY:
        # a form holds the effects that state another wanted gap
        drivers = tuple(effect for effect in drivers if not effect.wanted_gap)
        prepared = prepared._replace(fitted=form.fitted)
    steps.append(f"form of the baseline: {form.fitted.model.form.value}: {form.why}")
    null = Null(recorded_drive(prepared, usable, context.vehicle, trace.dt), catalogue, progress)
    refused = refused_baseline(prepared, context.vehicle, null)
    confirmed = confirmed_search.search_causes(
        null.drive,
        () if refused else drivers,
        prepared.fitted,
        lambda: null.noise(prepared.data, prepared.fitted),
        null.seed,
        progress,
    )
    searched = confirmed.search
    steps += confirmed.refused
    if silent and not searched.solved.model.effects and not answered(searched.data, searched.solved):
        return overall_verdict.with_context(report_parts.nothing(trace, NO_ANSWER, masked, steps), context)
    if refused:
        remnant = remnant_block.not_testable("The baseline does not describe the drive.")
        alone = driver_report(prepared, confirmed, null, (), masked, steps, form.why)
        alone = baseline_refused(alone, refused)
    else:
        remnant = _remnant(prepared, searched, drivers, catalogue)
        alone = driver_report(prepared, confirmed, null, drivers, masked, steps, form.why)
    report = overall_verdict.join(alone, remnant, context)
    if not refused:
        report = report._replace(model=_model(prepared, searched, context.vehicle, report))
    raw = None if trace is given else ready(given, usable, several.begins)
    if raw is not None:
        # what a wrong sensor did to the driver's parameters
        before = fit_of(raw.fitted, raw.fitted.fitted.model, raw.data, raw.trace.dt)
        report = report._replace(shifts=report_parts.shifts(before, report.extended))
    if several.spans and not refused:
        of = shared_causes.shared(searched.data, searched, several.spans, several.names)
        report = report._replace(drives=of.drives, differ=of.differ)
    if rivals:
        found = comparison.compare(prepared.data, report.closed_loop)
        report = report._replace(rivals=found, recommended=recommended(report.closed_loop, found))
    return report


def _remnant(
    prepared: Prepared, searched: Search, drivers: tuple[Effect, ...], catalogue: tuple[Effect, ...]
) -> RemnantReport:
    """Judge the innovations of the final driver model."""
    effects = tuple(effect for effect in catalogue if effect.kind is Kind.REMNANT)
    if any(one.effect.intermittent for one in searched.named):
        return remnant_block.not_testable(
            "The pedal stands still between decisions: its innovations have no law."
        )
    of = innovations(prepared.trace, searched.data, searched.solved)
    return remnant_block.diagnose_remnant(
        of, effects, held_out.dealt(searched.data), len(drivers) + len(effects)
    )


def _model(prepared: Prepared, searched: Search, vehicle: Vehicle, report: Report) -> IdentifiedModel | None:
    """The final model: with the driver's causes where they hold."""
    sound = [finding for finding in report.findings if not finding.surrogate]
    holds = any(finding.where == "driver" for finding in sound)
    data, solved = (searched.data, searched.solved) if holds else (prepared.data, searched.baseline)
    return final_model(prepared.trace, data, solved, vehicle, sound, report.output)
