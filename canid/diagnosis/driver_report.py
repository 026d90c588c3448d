"""The driver's part of a report: both models, their adequacy, what was named, and what it gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple
from zlib import crc32

import numpy as np

from canid.diagnosis import masks, report_parts, residual_maps
from canid.diagnosis.adequacy import adequacy
from canid.diagnosis.driver import (
    another_lead,
    baseline_check,
    baseline_form,
    closed_loop,
    detectability,
    driver_intervals,
    driver_search,
    held_out,
    model_averaging,
    pedal_holds,
    power,
)
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.driver.model_averaging import Alternative
from canid.diagnosis.driver.output_unit import in_output_unit
from canid.diagnosis.fitting.search import Named
from canid.diagnosis.null import baseline_fit, noise_source, verdict_null
from canid.diagnosis.null.confirmed_search import Confirmed
from canid.diagnosis.null.noise_source import Source
from canid.diagnosis.null.replicates import Drive
from canid.diagnosis.prepared_drive import Prepared
from canid.diagnosis.remnant.innovations import innovations
from canid.diagnosis.vehicle.vehicle_block import Vehicle
from canid.effects import CATALOGUE
from canid.effects.effect import Detector, Effect, Kind
from canid.findings import (
    Blocked,
    Finding,
    Fit,
    Flags,
    Masked,
    NotTestable,
    Report,
    Verdict,
)
from canid.types import NAN, Array, Interval, Trace


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


def refused_baseline(prepared: Prepared, vehicle: Vehicle, null: Null) -> str:
    """Why no cause may be named on this baseline; "": it may be judged.

    Stretches in which the pedal stands still are seen in the pedal itself: without them the baseline may hold.
    """
    car = vehicle.cars[0] if vehicle.cars is not None else None

    def usual() -> bool:
        noise = null.noise(prepared.data, prepared.fitted)
        return baseline_fit.usual(null.drive, prepared.fitted, noise, null.seed)

    if not baseline_check.refusal(prepared.data, prepared.fitted, car):
        return ""
    seen = pedal_holds.detect(prepared.data, prepared.fitted)
    if seen.pattern is None:
        return baseline_check.refusal(prepared.data, prepared.fitted, car, usual)
    data, fitted = driver_search.without_holds(prepared.data, prepared.fitted, seen)
    return baseline_check.refusal(data, fitted, car)


def baseline_refused(report: Report, why: str) -> Report:
    """The report on a drive whose baseline is refused: where it fails, and nothing that rests on it."""
    says = f"UNEXPLAINED: the baseline does not describe this drive: {why}."
    return report._replace(
        verdict=Verdict.UNEXPLAINED, says=says, unexplained=Interval(), blocks=(Blocked("driver", "unexplained", says),),
        advice=(why,), steps=(*report.steps, f"baseline refused: {why}"),
    )  # fmt: skip


def driver_report(
    prepared: Prepared,
    confirmed: Confirmed,
    null: Null,
    drivers: tuple[Effect, ...],
    masked: tuple[Masked, ...],
    steps: list[str],
    why_form: str,
) -> Report:
    """Make the driver's part of the report.

    Args:
        prepared: the drive and its baseline.
        confirmed: what was found on it.
        null: what findings are held against.
        drivers: candidates of the driver's block; (): the baseline was refused.
        masked: stretches that were left out.
        steps: what was done so far.
        why_form: why the baseline has its form.
    """
    trace, original = prepared.trace, prepared.data
    searched, folds, total = confirmed.search, confirmed.folds, another_lead.predicted(confirmed.gain)
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
    doubtful = [effect for effect in drivers if effect not in searched.among]
    others = model_averaging.alternatives(searched.candidates, doubtful, searched.data, solved)
    final = others if not searched.named else ()
    base = fit_of(before, before_out, original, dt, original, why_form, final)
    extended = fit_of(solved, after_out, original, dt, searched.data, why_form, others)
    sound = held.passed
    fitted = driver_intervals.parameters(solved, searched.data)
    findings = tuple(
        _finding(one, trace, original, fitted, sound, total)._replace(
            log_score_gain=confirmed.log_scores[one.effect.id], null_gain=confirmed.null_gain
        )
        for one in searched.named
    )
    verdict = report_parts.verdict(findings, sound)
    priced = detectability.shown(drivers, original, before)
    expected = {one.effect.id: one.expected for one in priced}
    decided = frozenset(name for f in findings for name in (f.effect, *f.rivals))
    undecided = detectability.undecided(priced, original, len(drivers), decided)
    tried = report_parts.tried(searched.steps, findings, expected)
    r0 = np.where(used, original.output.y - before_out, 0.0)
    r1 = np.where(used, original.output.y - after_out, 0.0)
    seen = original.seen
    steps = [
        *steps,
        f"baseline fitted on {int(before.rows.sum())} samples; noise autoregressive of order {before.noise.A.size - 1}",
        *(report_parts.step(one) for one in searched.named),
        f"{len({s.effect.id for s in searched.steps})} causes fitted in full, of {len(drivers)} tried",
        "residual adequate"
        if held.passed
        else "residual not adequate: " + "; ".join(report_parts.failed(held)),
    ]
    worst = residual_maps.worst(trace.t, r0, r1, used, dt)
    role = null.drive.role
    loop = closed_loop.simulate(trace, original, role, folds, searched.holds, vehicle)
    report = Report(
        verdict=verdict, says="", output=role, t=trace.t, measured=trace.output, used=used,
        baseline=base, extended=extended, findings=findings, unexplained=report_parts.unexplained(held), gain=total,
        not_testable=tuple(undecided), candidates_tried=len(drivers), tried=tried,
        checks=report_parts.adequacy_checks(held), masked=masked,
        blocks=(),
        worst=worst,
        maps=(
            residual_maps.operating_map(("speed", seen.speed), ("headway", seen.headway), r0, r1, used, dt),
            residual_maps.operating_map(("range_rate", seen.range_rate), ("gap", seen.gap), r0, r1, used, dt),
        ),
        spectra=residual_maps.spectra(r0, r1, {"headway_error": seen.headway, "range_rate": seen.range_rate}, used, dt),
        closed_loop=loop, shifts=report_parts.shifts(base, extended) if findings else {},
        advice=tuple(dict.fromkeys(_advice(undecided, findings, drivers))), steps=tuple(steps),
        log_score_gain=confirmed.log_score, null_gain=confirmed.null_gain,
        visible=power.visible(drivers, searched.data, solved) if held.passed else (),
    )  # fmt: skip
    says = report_parts.says(report, held, len(drivers))
    remarks = [*confirmed.refused, compared] if held.passed and compared else confirmed.refused
    withdrawn = "".join(f" {one[0].upper()}{one[1:]}." for one in remarks)
    return report._replace(
        says=says, blocks=(Blocked("driver", report_parts.state(verdict), says + withdrawn),)
    )


def fit_of(
    solved: FittedDriver,
    out: Array,
    data: DriverData,
    dt: float,
    fitted: DriverData | None = None,
    why_form: str = "",
    others: Sequence[Alternative] = (),
) -> Fit:
    """One model of the driver on the whole drive.

    Args:
        solved: the model.
        out: (n,) its simulation.
        data: the drive as measured.
        dt: s.
        fitted: what the model was fitted to; given, its intervals follow the likelihood.
        why_form: why the baseline has its form.
        others: models with one more effect, that widen the intervals.
    """
    used = data.output.usable & ~data.output.below
    y = data.output.y[used]
    left = y - out[used]
    variation = float(np.linalg.norm(y - y.mean()))
    percent = 100 * (1 - float(np.linalg.norm(left)) / variation) if variation > 0 else NAN
    shown = np.maximum(out, 0.0) if data.pedal else out
    form = baseline_form.stated(data, solved, why_form)
    return Fit(
        driver_intervals.channels(solved, dt, fitted, others), percent, shown, float(np.std(left)), form
    )


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
        estimates = report_parts.episode_parameters(one, float((data.output.usable.sum()) * data.output.dt))
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


def _explained(searched: Search) -> float:
    """Variance that the causes took from the residual, over what they left, on the samples that both models count."""
    rows = searched.baseline.rows & searched.solved.rows
    y = searched.data.output.y
    left = float(np.var((y - searched.solved.fitted.model)[rows]))
    return max(float(np.var((y - searched.baseline.fitted.model)[rows])) / max(left, 1e-12) - 1, 0.0)


def _advice(
    undecided: list[NotTestable], findings: tuple[Finding, ...], drivers: tuple[Effect, ...]
) -> list[str]:
    by = {effect.id: effect for effect in drivers}
    rivals = [f"{f.effect}: {by[f.effect].decides}" for f in findings if f.rivals and by[f.effect].decides]
    return rivals + [
        f"{' or '.join(n.effects)}: {by[n.effects[0]].decides}" for n in undecided if by[n.effects[0]].decides
    ]
