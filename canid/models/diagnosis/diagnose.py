"""Diagnosis of a drive: where the simulation is wrong, the cause, the extended model, and what it gains."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from canid.mathematics.estimators import output_stamps, pooled_drives, whole_drive, whole_drive_agreement
from canid.mathematics.identification.identifiability import quotable
from canid.models.diagnosis import car_following, corrections
from canid.models.diagnosis.corrections import Settings, Several, TooLittleError
from canid.models.diagnosis.lane import lane_keeping
from canid.models.diagnosis.report import nothing, report
from canid.models.diagnosis.several_drives import shared_car
from canid.models.diagnosis.several_drives.joined_drives import join
from canid.models.diagnosis.vehicle import pedal_record
from canid.models.effects import CATALOGUE, LANE_CATALOGUE
from canid.models.effects.effect import Detector, Effect
from canid.signals.signal_checks.drive_time import fitted_trace, of_trace
from canid.signals.signal_checks.output_ends import reached
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.findings import Report
from canid.values.text.names import capitalised
from canid.values.types import TASK_INPUTS, Channel, Trace

# s of driving that a diagnosis needs: in less than two minutes no cause stands out from chance (evidence grows with time)
MIN_DRIVING_S = 90.0


def diagnose(
    trace: Trace,
    *,
    catalogue: tuple[Effect, ...] | None = None,
    minimum: float = MIN_DRIVING_S,
    rivals: bool = False,
    estimators: Mapping[str, Any] | None = None,
    arbitrated: bool = True,
    progress: Callable[[float], None] = lambda _: None,
) -> Report:
    """Diagnose a drive: its sensors first, then the car, then the driver; of lane keeping, the driver alone.

    Args:
        trace: from `read_trace`.
        catalogue: the effects that may be named; None: those of the task.
        minimum: s of driving that must be there.
        rivals: calibrate published car-following models as well; some 2 s of CPU time per 10 min.
        estimators: settings of the methods of `identify`, which the numbers are held against; None: their defaults.
        arbitrated: hold them against it, which takes as long as `identify` does; False: causes alone are read.
        progress: is given the fraction of the replicates that are done, where a finding is held against them.

    Returns:
        a `Report`. A drive that decides nothing gets a verdict as well, never an exception.

    Example:
        >>> import canid
        >>> report = canid.diagnose(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        >>> report.verdict.value
        'adequate'
    """
    trace = with_limits(trace)
    if trace.input_names == TASK_INPUTS["lane_keeping"]:
        settings = Settings(LANE_CATALOGUE if catalogue is None else catalogue, minimum, progress)
        context = lane_keeping.context(trace)
    else:
        settings = Settings(CATALOGUE if catalogue is None else catalogue, minimum, progress, rivals)
        context = corrections.diagnose_context(trace, settings.catalogue)
    report = _diagnosed(trace, context, settings)
    return _arbitrated(report, [trace], estimators or {}) if arbitrated else report


def _arbitrated(report: Report, traces: Sequence[Trace], estimators: Mapping[str, Any]) -> Report:
    """Withhold what `identify` contradicts on the same drive, or on the same drives pooled."""
    channels = report.extended.channels
    if not any(quotable(channel, "K") for channel in channels.values()):
        return report
    # a stated latency is in neither
    every = [
        whole_drive.estimates(fitted_trace(trace), trace._replace(latency=None), estimators)
        for trace in traces
    ]
    whole = every[0] if len(every) == 1 else pooled_drives.pooled(every)
    without = _without_causes(report)
    findings = [finding for trace in traces for finding in output_stamps.standing(trace)]
    left, says, differs = whole_drive_agreement.diagnosed(channels, whole, without, findings)
    # without causes the last model is the baseline, but where the pedal's record ends
    alone = without is None and all(
        finding.effect not in pedal_record.CEILINGS for finding in report.findings
    )
    baseline = report.baseline._replace(channels=left) if alone else report.baseline
    extended = report.extended._replace(channels=left)
    return report._replace(baseline=baseline, extended=extended, contradictions=says, without_causes=differs)


def _without_causes(report: Report) -> Mapping[str, Channel] | None:
    """The driver without the causes named, which explain differences; {}: not sure which they are; None: none named."""
    causes = [finding for finding in report.findings if finding.where == "driver"]
    if not causes:
        return None
    # each cause moves the numbers by another amount
    sure = not any(cause.rivals or cause.surrogate for cause in causes)
    return report.baseline.channels if sure else {}


def diagnose_drives(
    traces: Sequence[Trace],
    names: Sequence[str],
    *,
    catalogue: tuple[Effect, ...] = CATALOGUE,
    minimum: float = MIN_DRIVING_S,
    rivals: bool = False,
    estimators: Mapping[str, Any] | None = None,
    arbitrated: bool = True,
    null_gain: bool = True,
    progress: Callable[[float], None] = lambda _: None,
) -> Report:
    """Diagnose several drives of one driver in one car together.

    Causes and parameters are those of all drives; each drive has an offset of its own. What was found is then held against
    each drive by a fit to the others, and what differs between the drives is said. The numbers are held against what
    `identify` says of each drive, pooled.

    Args:
        traces: from `read_trace`, with one vehicle file.
        names: of the drives.
        catalogue: the effects that may be named.
        minimum: s of driving that must be there, on all drives together.
        rivals: as in `diagnose`.
        estimators: as in `diagnose`.
        arbitrated: as in `diagnose`.
        null_gain: say what the simulation gains without the causes, by the driver's own noise, which takes as long as it
            takes to show that they are none.
        progress: as in `diagnose`.

    Returns:
        One `Report`; `drives` and `differ` say what each drive makes of it.

    Raises:
        ConfigError: the drives differ in step, inputs, or output filter.
    """
    joined = join(traces)
    several = Several(joined.spans, tuple(names))
    settings = Settings(catalogue, minimum, progress, rivals, several, null_gain)
    context = corrections.diagnose_context(joined.trace, catalogue)
    report = _diagnosed(joined.trace, context, settings)._replace(time=joined.time)
    return _arbitrated(report, traces, estimators or {}) if arbitrated else report


def diagnose_car(
    traces: Sequence[Trace],
    names: Sequence[str],
    *,
    catalogue: tuple[Effect, ...] = CATALOGUE,
    minimum: float = MIN_DRIVING_S,
    rivals: bool = False,
    estimators: Mapping[str, Any] | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> tuple[Report, ...]:
    """Diagnose several drives of one car, whoever drove: sensors and car on all of them together, each driver by himself.

    Args:
        traces: from `read_trace`, with one vehicle file.
        names: of the drives.
        catalogue: the effects that may be named.
        minimum: s of driving that must be there, on each drive.
        rivals: as in `diagnose`.
        estimators: as in `diagnose`.
        progress: as in `diagnose`, of each drive in turn.

    Returns:
        One `Report` of each drive. Their blocks of sensing and vehicle rest on all drives; `drives` says what the
        findings in the car gain on each drive by a fit to the others.

    Raises:
        ConfigError: the drives differ in step, inputs, or output filter.
    """
    traces = [with_limits(trace) for trace in traces]
    joined = join(traces)
    car = shared_car.diagnose_car(joined, traces, names, catalogue)
    out = []
    for k, (trace, context) in enumerate(zip(traces, car.contexts, strict=True)):

        def part(done: float, k: int = k) -> None:
            progress((k + done) / len(traces))

        report = _diagnosed(trace, context, Settings(catalogue, minimum, part, rivals))
        out.append(_arbitrated(report._replace(drives=car.drives), [trace], estimators or {}))
    return tuple(out)


def _diagnosed(trace: Trace, context: corrections.Context, settings: Settings) -> Report:
    """Correct, prepare, search, assess, report: of either task, of one drive or of several on one trace."""
    task = lane_keeping if trace.input_names == TASK_INPUTS["lane_keeping"] else car_following
    settings = settings._replace(catalogue=_shown_by(trace, settings.catalogue))
    corrected = corrections.correct(trace, context, settings)
    try:
        prepared = task.prepare(corrected)
        searched = task.search(prepared)
        made = report(task.assess(searched))
    except TooLittleError as missing:
        made = nothing(corrected, missing)
    steps = (*(f"{capitalised(end.says)}." for end in reached(trace)), *made.steps)
    return made._replace(signals=trace.findings, time=of_trace(trace), steps=steps)


def _shown_by(trace: Trace, catalogue: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Effects that this output can show: one that is itself updated slowly shows no holds and no rhythm of the driver's.

    Nor does it show a delay, and with it an effect that is one, or does what a shorter delay does.

    Of several drives together a slow one holds the search back on all: it is one search.
    """
    if all(finding.name != output_stamps.SLOW for finding in trace.findings):
        return catalogue
    still = {Detector.PEDAL_HOLDS, Detector.PEDAL_RHYTHM}
    return tuple(
        effect
        for effect in catalogue
        if not still & set(effect.detectors) and effect.dead_time is None and not effect.shortens_dead_time
    )
