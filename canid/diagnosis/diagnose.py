"""Diagnosis of a drive: where the simulation is wrong, the cause, the extended model, and what it gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple
from zlib import crc32

import numpy as np

from canid.diagnosis import corrections, masks, overall_verdict, residual_maps, signal_findings
from canid.diagnosis.adequacy import adequacy
from canid.diagnosis.driver import (
    baseline_check,
    baseline_form,
    closed_loop,
    detectability,
    driver_intervals,
    driver_search,
    held_out,
    pedal_holds,
)
from canid.diagnosis.driver.driver_data import DriverData, prepare
from canid.diagnosis.driver.driver_fit import FittedDriver, answered, baseline
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.driver.output_unit import in_output_unit
from canid.diagnosis.final_model import final_model
from canid.diagnosis.fitting.search import Named
from canid.diagnosis.null import confirmed_search, noise_source, verdict_null
from canid.diagnosis.null.confirmed_search import Confirmed
from canid.diagnosis.null.noise_source import Source
from canid.diagnosis.null.replicates import Drive
from canid.diagnosis.remnant import remnant_block
from canid.diagnosis.remnant.innovations import innovations
from canid.diagnosis.remnant.remnant_block import RemnantReport
from canid.diagnosis.rivals import comparison
from canid.diagnosis.several_drives import shared_causes
from canid.diagnosis.several_drives.joined_drives import join
from canid.diagnosis.vehicle.vehicle_block import Vehicle
from canid.effects import CATALOGUE
from canid.effects.effect import Detector, Effect, Kind
from canid.effects.wanted_gap import Form
from canid.findings import (
    Blocked,
    Check,
    Finding,
    Fit,
    Flags,
    Masked,
    NotTestable,
    Report,
    Tried,
    Verdict,
    masked_for,
    no_fit,
)
from canid.identification.confidence import SIGMAS
from canid.identified_model import IdentifiedModel
from canid.signal_checks.drive_time import behind_a_lead, of_trace
from canid.types import NAN, Array, Interval, Trace

# s of driving that a diagnosis needs: in less than two minutes no cause stands out from chance (evidence grows with time)
MIN_DRIVING_S = 90.0
# m/s and output units; a lead whose speed varies less excites nothing, an output that varies less answers nothing
STILL_RATE, STILL_OUTPUT = 0.05, 1e-3
# innovation over residual below which the output's noise has no content at this rate (a smoothed acceleration):
# whitening it would amplify rounding, so every second sample is left out until it has
MIN_INNOVATION_SHARE = 0.04
MAX_SAMPLE_TIME_S = 0.8

NO_ANSWER = (
    "the output answers neither headway nor relative speed by more than chance: is it the right signal? "
    "If it is, drive longer behind a lead whose speed changes"
)


class Prepared(NamedTuple):
    """A drive that can be diagnosed."""

    trace: Trace
    data: DriverData
    fitted: FittedDriver


def diagnose(
    trace: Trace,
    *,
    catalogue: tuple[Effect, ...] = CATALOGUE,
    minimum: float = MIN_DRIVING_S,
    rivals: bool = False,
    progress: Callable[[float], None] = lambda _: None,
) -> Report:
    """Diagnose a drive: its sensors first, then the car, then the driver.

    Args:
        trace: from `read_trace`.
        catalogue: the effects that may be named.
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
    report = _diagnosed(trace, catalogue, minimum, rivals, progress, Several())
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
    report = _diagnosed(joined.trace, catalogue, minimum, rivals, progress, several)
    return report._replace(signals=joined.trace.findings, time=joined.time)


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
    catalogue: tuple[Effect, ...],
    minimum: float,
    rivals: bool,
    progress: Callable[[float], None],
    several: Several,
) -> Report:
    context = corrections.diagnose_context(trace, catalogue)
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
        return overall_verdict.with_context(nothing(trace, missing, masked, steps), context)
    prepared = ready(trace, usable, several.begins)
    if prepared is None:
        why = "too few samples in a row in which a person drives behind a lead"
        return overall_verdict.with_context(nothing(trace, why, masked, steps), context)
    silent = not answered(prepared.data, prepared.fitted)
    # a pedal that stands at its ceiling most of the time still answers below it
    if silent and pedal_holds.detect(prepared.data, prepared.fitted).pattern is not Detector.PEDAL_CEILING:
        return overall_verdict.with_context(nothing(trace, NO_ANSWER, masked, steps), context)
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
    refused = refused_baseline(prepared, context.vehicle)
    null = Null(recorded_drive(prepared, usable, context.vehicle, trace.dt), catalogue, progress)
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
        return overall_verdict.with_context(nothing(trace, NO_ANSWER, masked, steps), context)
    if refused:
        remnant = remnant_block.not_testable("The baseline does not describe the drive.")
        alone = _report(prepared, confirmed, null, (), masked, steps, form.why)
        alone = baseline_refused(alone, refused)
    else:
        remnant = _remnant(prepared, searched, drivers, catalogue)
        alone = _report(prepared, confirmed, null, drivers, masked, steps, form.why)
    report = overall_verdict.join(alone, remnant, context)
    if not refused:
        report = report._replace(model=_model(prepared, searched, context.vehicle, report))
    raw = None if trace is given else ready(given, usable, several.begins)
    if raw is not None:
        # what a wrong sensor did to the driver's parameters
        before = _fit(raw.fitted, raw.fitted.fitted.model, raw.data, raw.trace.dt)
        report = report._replace(shifts=_shifts(before, report.extended))
    if several.spans and not refused:
        of = shared_causes.shared(searched.data, searched, several.spans, several.names)
        report = report._replace(drives=of.drives, differ=of.differ)
    if rivals:
        report = report._replace(rivals=comparison.compare(prepared.data, report.closed_loop))
    return report


class Null(NamedTuple):
    """What findings are held against: the drive, simulated again with its driver's own noise."""

    drive: Drive
    catalogue: tuple[Effect, ...]
    progress: Callable[[float], None]

    @property
    def seed(self) -> int:
        """The same drive gives the same replicates."""
        return crc32(np.ascontiguousarray(self.drive.trace.output).tobytes())

    def noise(self, data: DriverData, solved: FittedDriver) -> Source:
        """Noise of a fitted driver."""
        effects = [effect for effect in self.catalogue if effect.kind is Kind.REMNANT]
        of = innovations(self.drive.trace, data, solved)
        left = data.output.y - solved.fitted.model
        return noise_source.source(of, solved.noise, left, effects, self.drive.trace.signals.get("accel"))


def recorded_drive(prepared: Prepared, usable: Flags, vehicle: Vehicle, dt: float) -> Drive:
    """The drive on the grid that the driver was fitted on."""
    trace = prepared.trace
    role = masks.output_role(trace)
    return Drive(trace, usable[:: round(trace.dt / dt)], prepared.data, role, vehicle)


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


def ready(trace: Trace, usable: Flags, begins: tuple[float, ...] = ()) -> Prepared | None:
    """Fit the baseline at the rate at which the output has content.

    Args:
        trace: of a drive, or of several.
        usable: (n,) samples that no mask has taken.
        begins: s, of each further drive.
    """
    while True:
        data = prepare(trace, usable, begins)
        fitted = baseline(data)
        if fitted is None:
            return None
        left = (data.output.y - fitted.fitted.model)[data.output.usable & ~data.output.below]
        if (
            fitted.noise.sd >= MIN_INNOVATION_SHARE * float(np.std(left))
            or 2 * trace.dt > MAX_SAMPLE_TIME_S + 1e-9
        ):
            return Prepared(trace, data, fitted)
        trace, usable = thinned(trace), usable[::2]


def thinned(trace: Trace) -> Trace:
    """Every second sample."""
    return trace._replace(
        dt=2 * trace.dt,
        t=trace.t[::2],
        output=trace.output[::2],
        inputs=trace.inputs[::2],
        gate=trace.gate[::2],
        learn=trace.learn[::2],
        segment=trace.segment[::2],
        signals={role: x[::2] for role, x in trace.signals.items()},
    )


def lacking(trace: Trace, usable: Flags, masked: tuple[Masked, ...], minimum: float) -> str:
    """Say what is missing for a diagnosis, and what to do; "": nothing."""
    need = f"drive {minimum / 60:.2g} min or more behind a lead whose speed changes"
    if trace.input_names != ("headway_error", "range_rate"):
        return "the diagnosis knows car following only: this vehicle's task is another one"
    n = trace.t.size
    if n * trace.dt < minimum:
        return f"the log lasts {n * trace.dt:.0f} s{_rest(masked)}; {need}"
    for role in ("speed", "gap", "range_rate"):
        known = np.isfinite(trace.signals.get(role, np.full(n, NAN)))
        if known.sum() * trace.dt < minimum:
            what = "no speed" if role == "speed" else "no lead"
            return f"{what}: `{role}` is there for {known.sum() * trace.dt:.0f} s only; {need}"
    if np.isfinite(trace.output).sum() * trace.dt < minimum:
        return "the driver's output is not in the log; map it in the vehicle file ([driver] output)"
    follows = behind_a_lead(trace.gate)
    seconds = float((usable & follows).sum() * trace.dt)
    if seconds < minimum:
        return f"a person follows a lead for {seconds:.0f} s only{_rest(masked)}; {need}"
    here = usable & follows & np.isfinite(trace.output) & np.isfinite(trace.signals["range_rate"])
    if float(np.std(trace.output[here])) < STILL_OUTPUT:
        return "the driver's output never moves: is it the right signal, and does a person drive?"
    if float(np.std(trace.signals["range_rate"][here])) < STILL_RATE:
        return f"the lead's speed never changes, so nothing is answered; {need}"
    return ""


def _rest(masked: tuple[Masked, ...]) -> str:
    """Masked times, for a sentence."""
    spans = [f"{effect} for {seconds:.0f} s" for effect, seconds in masked_for(masked).items()]
    return f" ({', '.join(spans)} masked)" if spans else ""


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


def refused_baseline(prepared: Prepared, vehicle: Vehicle) -> str:
    """Why no cause may be named on this baseline; "": it may be judged.

    Stretches in which the pedal stands still are seen in the pedal itself: without them the baseline may hold.
    """
    car = vehicle.cars[0] if vehicle.cars is not None else None
    why = baseline_check.refusal(prepared.data, prepared.fitted, car)
    if not why:
        return ""
    seen = pedal_holds.detect(prepared.data, prepared.fitted)
    if seen.pattern is None:
        return why
    data, fitted = driver_search.without_holds(prepared.data, prepared.fitted, seen)
    return baseline_check.refusal(data, fitted, car)


def baseline_refused(report: Report, why: str) -> Report:
    """The report on a drive whose baseline is refused: where it fails, and nothing that rests on it."""
    says = f"UNEXPLAINED: the baseline does not describe this drive: {why}."
    return report._replace(
        verdict=Verdict.UNEXPLAINED, says=says, unexplained=Interval(), blocks=(Blocked("driver", "unexplained", says),),
        advice=(why,), steps=(*report.steps, f"baseline refused: {why}"),
    )  # fmt: skip


def _report(
    prepared: Prepared,
    confirmed: Confirmed,
    null: Null,
    drivers: tuple[Effect, ...],
    masked: tuple[Masked, ...],
    steps: list[str],
    why_form: str,
) -> Report:
    trace, original = prepared.trace, prepared.data
    searched, folds, total = confirmed.search, confirmed.folds, confirmed.gain
    vehicle = null.drive.vehicle
    dt = trace.dt
    before, solved = searched.baseline, searched.solved
    explained = _explained(searched)
    held = adequacy.assess(searched, original, explained)
    compared = ""
    if not held.passed and drivers:
        noise = null.noise(searched.data, solved)
        held, compared = verdict_null.judge(
            null.drive, searched, held, noise, explained, null.seed, null.progress
        )
        steps = [*steps, compared] if compared else steps
    before_out = before.fitted.model
    after_out = held_out.simulated(searched, searched.data, solved, searched.random_walk)
    used = original.output.usable & ~original.output.below
    base = _fit(before, before_out, original, dt, original, why_form)
    extended = _fit(solved, after_out, original, dt, searched.data, why_form)
    sound = held.passed
    fitted = driver_intervals.parameters(solved, searched.data)
    findings = tuple(
        _finding(one, trace, original, fitted, sound, total)._replace(
            log_score_gain=confirmed.log_scores[one.effect.id], null_gain=confirmed.null_gain
        )
        for one in searched.named
    )
    verdict = _verdict(findings, sound)
    priced = detectability.shown(drivers, original, before)
    expected = {one.effect.id: one.expected for one in priced}
    decided = frozenset(name for f in findings for name in (f.effect, *f.rivals))
    undecided = detectability.undecided(priced, original, len(drivers), decided)
    tried = _tried(searched, findings, expected)
    r0 = np.where(used, original.output.y - before_out, 0.0)
    r1 = np.where(used, original.output.y - after_out, 0.0)
    seen = original.seen
    steps = [
        *steps,
        f"baseline fitted on {int(before.rows.sum())} samples; noise autoregressive of order {before.noise.A.size - 1}",
        *(_step(one) for one in searched.named),
        f"{len({s.effect.id for s in searched.steps})} causes fitted in full, of {len(drivers)} tried",
        "residual adequate" if held.passed else "residual not adequate: " + "; ".join(_failed(held)),
    ]
    worst = residual_maps.worst(trace.t, r0, r1, used, dt)
    role = null.drive.role
    loop = closed_loop.simulate(trace, original, role, folds, searched.holds, vehicle)
    report = Report(
        verdict=verdict, says="", output=role, t=trace.t, measured=trace.output, used=used,
        baseline=base, extended=extended, findings=findings, unexplained=_unexplained(held), gain=total,
        not_testable=tuple(undecided), candidates_tried=len(drivers), tried=tried,
        checks=_adequacy_checks(held), masked=masked,
        blocks=(),
        worst=worst,
        maps=(
            residual_maps.operating_map(("speed", seen.speed), ("headway", seen.headway), r0, r1, used, dt),
            residual_maps.operating_map(("range_rate", seen.range_rate), ("gap", seen.gap), r0, r1, used, dt),
        ),
        spectra=residual_maps.spectra(r0, r1, {"headway_error": seen.headway, "range_rate": seen.range_rate}, used, dt),
        closed_loop=loop, shifts=_shifts(base, extended) if findings else {},
        advice=tuple(dict.fromkeys(_advice(undecided, findings, drivers))), steps=tuple(steps),
        log_score_gain=confirmed.log_score, null_gain=confirmed.null_gain,
    )  # fmt: skip
    says = _says(report, held, len(drivers))
    remarks = [*confirmed.refused, compared] if held.passed and compared else confirmed.refused
    withdrawn = "".join(f" {one[0].upper()}{one[1:]}." for one in remarks)
    return report._replace(says=says, blocks=(Blocked("driver", _state(verdict), says + withdrawn),))


def _tried(searched: Search, findings: tuple[Finding, ...], expected: dict[str, float]) -> tuple[Tried, ...]:
    """Every step of the search, with its outcome and the evidence that a typical strength would have."""
    rivals = {rival for finding in findings for rival in finding.rivals}
    return tuple(
        Tried(
            s.effect.id, s.effect.where, s.step, s.evidence, s.needed, expected.get(s.effect.id, NAN),
            "accepted" if s.accepted else "rival" if s.effect.id in rivals else "rejected",
            "" if s.accepted else "another one explained more" if s.evidence > s.needed else "chance explains as much",
        )
        for s in searched.steps
    )  # fmt: skip


def _fit(
    solved: FittedDriver,
    out: Array,
    data: DriverData,
    dt: float,
    fitted: DriverData | None = None,
    why_form: str = "",
) -> Fit:
    used = data.output.usable & ~data.output.below
    y = data.output.y[used]
    left = y - out[used]
    variation = float(np.linalg.norm(y - y.mean()))
    percent = 100 * (1 - float(np.linalg.norm(left)) / variation) if variation > 0 else NAN
    shown = np.maximum(out, 0.0) if data.pedal else out
    form = baseline_form.stated(data, solved, why_form)
    return Fit(driver_intervals.channels(solved, dt, fitted), percent, shown, float(np.std(left)), form)


def _finding(
    one: Named,
    trace: Trace,
    data: DriverData,
    fitted: dict[str, dict[str, Interval]],
    passed: bool,
    gain: Interval,
) -> Finding:
    estimates = dict(fitted.get(one.effect.id, {}))
    if one.estimate is not None:
        estimates = {one.effect.parameters[0].name: one.estimate}
    if one.episodes and Detector.PEDAL_CEILING not in one.effect.detectors:
        estimates = _rhythm(one, float((data.output.usable.sum()) * data.output.dt))
    says = in_output_unit(one.effect.says, pedal=data.pedal)
    for name, iv in estimates.items():
        says = says.replace("{" + name + "}", f"{iv.value:.3g} [{iv.low:.3g}, {iv.high:.3g}]")
    return Finding(
        effect=one.effect.id, where=one.effect.where, rivals=possible(one.rivals, trace, data), surrogate=not passed,
        parameters=estimates, units={p.name: in_output_unit(p.unit, pedal=data.pedal) for p in one.effect.parameters},
        gain=gain, says=says, evidence=one.evidence, needed=one.needed, episodes=one.episodes,
    )  # fmt: skip


def possible(rivals: tuple[str, ...], trace: Trace, data: DriverData) -> tuple[str, ...]:
    """Rivals that this log can have: their signals are measured, and a car lies between the output and the motion."""
    by = {effect.id: effect for effect in CATALOGUE}
    return tuple(
        rival
        for rival in rivals
        if rival not in by
        or (
            all(role in trace.signals for role in by[rival].needs)
            and (data.pedal or by[rival].where != "vehicle")
        )
    )


def _rhythm(one: Named, seconds: float) -> dict[str, Interval]:
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


def _verdict(findings: tuple[Finding, ...], passed: bool) -> Verdict:
    if not passed:
        return Verdict.UNEXPLAINED
    if not findings:
        return Verdict.ADEQUATE
    return Verdict.ONE_OF if any(finding.rivals for finding in findings) else Verdict.NAMED


def _state(verdict: Verdict) -> str:
    return {Verdict.ADEQUATE: "adequate", Verdict.UNEXPLAINED: "unexplained"}.get(verdict, "wrong")


def _explained(searched: Search) -> float:
    """Variance that the causes took from the residual, over what they left, on the samples that both models count."""
    rows = searched.baseline.rows & searched.solved.rows
    y = searched.data.output.y
    left = float(np.var((y - searched.solved.fitted.model)[rows]))
    return max(float(np.var((y - searched.baseline.fitted.model)[rows])) / max(left, 1e-12) - 1, 0.0)


def _failed(held: adequacy.Adequacy) -> list[str]:
    return [f"{f.says} (p {f.p:.1g}, {100 * f.share:.0f} % of the residual)" for f in held.failed]


def _says(report: Report, held: adequacy.Adequacy, tried: int) -> str:
    verdict, findings, worst = report.verdict, report.findings, report.worst
    better = overall_verdict.gained(report)
    if verdict is Verdict.ADEQUATE:
        return (
            f"ADEQUATE: none of {tried} causes explains more than chance, "
            "and the residual holds nothing of the inputs."
        )
    if verdict is Verdict.UNEXPLAINED:
        what = "; ".join(_failed(held))
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


def _unexplained(held: adequacy.Adequacy) -> Interval:
    """Share of the residual's variance that the strongest failed family would explain."""
    if not held.failed:
        return Interval(0.0, 0.0, max((f.share for f in held.families), default=0.0))
    worst = max(held.failed, key=lambda f: f.share)
    # the statistic is a noncentral chi-squared: its standard deviation is sqrt(2 (k + 2 λ))
    half = SIGMAS * float(np.sqrt(2 * (worst.dimensions + 2 * worst.statistic))) / max(worst.statistic, 1e-9)
    return Interval(worst.share, max(worst.share * (1 - half), 0.0), min(worst.share * (1 + half), 1.0))


def _adequacy_checks(held: adequacy.Adequacy) -> tuple[Check, ...]:
    return tuple(
        Check(f.name, f not in held.failed, f.p, held.bound,
              f"{f.says}: chance {f.p:.2g} over {f.dimensions} directions, {100 * f.share:.1f} % of the residual's variance",
              gate=True)
        for f in held.families
    )  # fmt: skip


def _shifts(before: Fit, after: Fit) -> dict[str, tuple[Interval, Interval]]:
    out = {}
    for name, channel in after.channels.items():
        first = before.channels[name]
        for what in ("K", "tau", "dead_time", "tau_plus_dead_time"):
            out[f"{name} {what}"] = (getattr(first, what), getattr(channel, what))
    return out


def _step(one: Named) -> str:
    return f"{one.effect.id} accepted: evidence {one.evidence:.0f}, needed {one.needed:.0f}"


def _advice(
    undecided: list[NotTestable], findings: tuple[Finding, ...], drivers: tuple[Effect, ...]
) -> list[str]:
    by = {effect.id: effect for effect in drivers}
    rivals = [f"{f.effect}: {by[f.effect].decides}" for f in findings if f.rivals and by[f.effect].decides]
    return rivals + [
        f"{' or '.join(n.effects)}: {by[n.effects[0]].decides}" for n in undecided if by[n.effects[0]].decides
    ]
