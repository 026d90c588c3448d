"""Diagnosis of a driver who follows a lead: the baseline, the search for causes on it, and what they are worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.adequacy import adequacy
from canid.models.diagnosis.adequacy.adequacy import Adequacy
from canid.models.diagnosis.corrections import Corrected, TooLittleError
from canid.models.diagnosis.driver import (
    baseline_form,
    closed_loop,
    detectability,
    driver_intervals,
    held_out,
    model_averaging,
    noise_law,
    pedal_holds,
)
from canid.models.diagnosis.driver.detectability import in_output_unit
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver, answered
from canid.models.diagnosis.driver.driver_model import DriverModel
from canid.models.diagnosis.driver.model_averaging import Alternative
from canid.models.diagnosis.final_model import final_model
from canid.models.diagnosis.null import confirmed_search, verdict_null
from canid.models.diagnosis.null.baseline_check import refused_baseline
from canid.models.diagnosis.null.confirmed_search import Confirmed
from canid.models.diagnosis.null.following_block import Following
from canid.models.diagnosis.null.replicates import Null, recorded_drive
from canid.models.diagnosis.prepared_drive import Prepared, lacking, ready
from canid.models.diagnosis.remnant import remnant_block
from canid.models.diagnosis.remnant.innovations import innovations
from canid.models.diagnosis.remnant.remnant_block import RemnantReport
from canid.models.diagnosis.report import (
    Assessed,
    all_findings,
    explained,
    finding,
    fit_quality,
    search_steps,
)
from canid.models.diagnosis.rivals import comparison
from canid.models.diagnosis.rivals.recommendation import recommended
from canid.models.diagnosis.several_drives import shared_causes
from canid.models.diagnosis.vehicle import pedal_record
from canid.models.diagnosis.verdict import Gained
from canid.models.effects import CATALOGUE
from canid.models.effects.effect import Detector, Effect, Kind
from canid.models.effects.wanted_gap import Form
from canid.values.findings import Finding, Fit, NotTestable
from canid.values.text.names import either, readable
from canid.values.text.numbers import number
from canid.values.types import Array, Interval, Trace

NO_ANSWER = (
    "the output answers neither headway nor relative speed by more than chance: is it the right signal? "
    "If it is, drive longer behind a lead whose speed changes"
)


class Baseline(NamedTuple):
    """A drive whose driver may be searched for causes."""

    corrected: Corrected
    prepared: Prepared
    drivers: tuple[Effect, ...]  # candidates of the driver's block
    why_form: str  # why the baseline has its form
    silent: bool  # it answers nothing, but at a pedal's ceiling
    null: Null
    steps: tuple[str, ...]


class Searched(NamedTuple):
    """What the search found on a baseline."""

    baseline: Baseline
    confirmed: Confirmed[DriverData, DriverModel]
    refused: str  # why the baseline does not describe the drive; "": it does
    steps: tuple[str, ...]


def prepare(corrected: Corrected) -> Baseline:
    """Fit the baseline, and choose its form.

    Args:
        corrected: the drive.

    Raises:
        TooLittleError: too little was measured, or the output answers nothing.
    """
    given, usable, settings = corrected.trace, corrected.usable, corrected.settings
    steps = corrected.steps
    missing = corrected.lacking or lacking(given, usable, corrected.masked, settings.minimum)
    if missing:
        raise TooLittleError(missing, steps)
    prepared = ready(given, usable, settings.several.begins)
    if prepared is None:
        raise TooLittleError("too few samples in a row in which a person drives behind a lead", steps)
    prepared = prepared._replace(fitted=noise_law.with_law(prepared.data, prepared.fitted))
    silent = not answered(prepared.data, prepared.fitted)
    # a pedal that stands at its ceiling most of the time still answers below it
    if silent and pedal_holds.detect(prepared.data, prepared.fitted).pattern is not Detector.PEDAL_CEILING:
        raise TooLittleError(NO_ANSWER, steps)
    if prepared.trace.dt > given.dt * 1.5:
        steps += (
            f"the output has no content of its own above {0.5 / prepared.trace.dt:.2g} Hz: "
            f"sampled every {prepared.trace.dt:.1f} s",
        )
    steps += noise_law.stated(prepared.fitted)
    drivers = tuple(
        effect for effect in settings.catalogue if effect.where == "driver" and effect.kind is not Kind.MASK
    )
    form = baseline_form.choose(prepared.trace, prepared.data, prepared.fitted, drivers)
    if form.fitted.model.form is not Form.TIME_HEADWAY:
        # a form holds the effects that state another wanted gap
        drivers = tuple(effect for effect in drivers if not effect.wanted_gap)
        prepared = prepared._replace(fitted=form.fitted)
    steps += (f"form of the baseline: {form.fitted.model.form.value}: {form.why}",)
    drive = recorded_drive(prepared, usable, corrected.context.vehicle, given.dt)
    null = Null(drive, settings.catalogue, settings.progress, settings.null_gain)
    return Baseline(corrected, prepared, drivers, form.why, silent, null, steps)


def search(base: Baseline) -> Searched:
    """Search for causes until every name stands; on a baseline that does not describe the drive, for none.

    Args:
        base: the drive and its baseline.

    Raises:
        TooLittleError: the output answers nothing with its causes either.
    """
    prepared, null = base.prepared, base.null
    refused = refused_baseline(prepared, base.corrected.context.vehicle)
    drivers = () if refused else base.drivers
    block = Following(null, prepared.fitted, drivers)
    confirmed = confirmed_search.search_causes(block, drivers, null.progress)
    search_result, steps = confirmed.search, (*base.steps, *confirmed.refused)
    if (
        base.silent
        and not search_result.solved.model.effects
        and not answered(search_result.data, search_result.solved)
    ):
        raise TooLittleError(NO_ANSWER, steps)
    return Searched(base._replace(drivers=drivers), confirmed, refused, steps)


def assess(searched: Searched) -> Assessed:
    """Test what the final model leaves, and what the causes are worth.

    Args:
        searched: what was found.
    """
    base, confirmed = searched.baseline, searched.confirmed
    corrected, prepared, drivers, null = base.corrected, base.prepared, base.drivers, base.null
    trace, original, search_result, drive = prepared.trace, prepared.data, confirmed.search, null.drive
    before, solved = search_result.baseline, search_result.solved
    won = explained(before, solved, search_result.data)
    held, compared = adequacy.assess(search_result, original, won), ""
    if not held.passed and drivers:
        noise = null.noise(search_result.data, solved)
        held, compared = verdict_null.judge(drive, search_result, held, noise, won, null.seed, null.progress)
    gained = Gained(held_out.predicted(confirmed.gain), confirmed.null_gain, confirmed.log_score)
    findings = _findings(confirmed, trace, original, held, gained)
    findings = tuple(_limit_of_record(each, corrected) for each in findings)
    after_out = held_out.simulated(search_result, solved, search_result.random_walk)
    doubtful = [effect for effect in drivers if effect not in search_result.among]
    others = model_averaging.alternatives(search_result.candidates, doubtful, search_result.data, solved)
    final = others if not search_result.named else ()
    priced = detectability.shown(drivers, original, before)
    decided = frozenset(name for f in findings for name in (f.effect, *f.rivals))
    visible = detectability.visible(drivers, search_result.data, solved) if held.passed else ()
    shows = detectability.at_typical(visible, drivers, search_result.data)
    undecided = detectability.undecided(priced, original, len(drivers), decided, shows)
    remarks = [*confirmed.refused, compared] if held.passed and compared else confirmed.refused
    rows, order = int(before.rows.sum()), before.noise.A.size - 1
    seen = original.seen
    tested = Assessed(
        corrected, trace, original.output.usable & ~original.output.hidden,
        fit_of(before, before.fitted.model, original, trace.dt, original, base.why_form, final),
        fit_of(solved, after_out, original, trace.dt, search_result.data, base.why_form, others),
        (before.fitted.model, after_out), findings, held, gained, len(drivers), search_result.steps,
        expected={priced_effect.effect.id: priced_effect.expected for priced_effect in priced},
        undecided=undecided,
        advice=_advice(undecided, findings, drivers),
        steps=(
            *searched.steps,
            *([compared] if compared else []),
            *search_steps(held, search_result.named, search_result.steps, len(drivers), rows, order),
        ),
        remarks=[f"{remark[0].upper()}{remark[1:]}" for remark in remarks],
        maps=[
            (("speed", seen.speed), ("headway", seen.headway)),
            (("range_rate", seen.range_rate), ("gap", seen.gap)),
        ],
        inputs={"headway_error": seen.headway, "range_rate": seen.range_rate},
        remnant=_remnant(searched),
        refused=searched.refused,
        raw=_as_measured(corrected),
        visible=visible,
        closed_loop=closed_loop.simulate(
            trace, original, drive.role, confirmed.folds, search_result.holds, drive.vehicle
        ),
    )  # fmt: skip
    return _compared(tested, searched)


def _compared(tested: Assessed, searched: Searched) -> Assessed:
    """Add the model to simulate with, what each of several drives says, and published models."""
    prepared, search_result = searched.baseline.prepared, searched.confirmed.search
    settings = tested.corrected.settings
    if not searched.refused:
        sound = [stated for stated in all_findings(tested) if not stated.surrogate]
        # with the driver's causes, and the end of the pedal's record, where they hold
        holds = any(stated in tested.findings for stated in sound)
        data, solved = (
            (search_result.data, search_result.solved) if holds else (prepared.data, search_result.baseline)
        )
        drive = searched.baseline.null.drive
        model = final_model(prepared.trace, data, solved, drive.vehicle, sound, drive.role)
        tested = tested._replace(model=model)
        if settings.several.spans:
            each = shared_causes.shared(search_result.data, search_result, *settings.several)
            tested = tested._replace(drives=each.drives, differ=each.differ)
    if settings.rivals:
        rivals = comparison.compare(prepared.data, tested.closed_loop)
        tested = tested._replace(rivals=rivals, recommended=recommended(tested.closed_loop, rivals))
    return tested


def _as_measured(corrected: Corrected) -> Fit | None:
    """What a wrong sensor did to the driver's parameters; None: nothing was corrected."""
    if corrected.trace is corrected.given:
        return None
    raw = ready(corrected.given, corrected.usable, corrected.settings.several.begins)
    return raw and fit_of(raw.fitted, raw.fitted.fitted.model, raw.data, raw.trace.dt)


def _remnant(searched: Searched) -> RemnantReport:
    """Judge the innovations of the final driver model."""
    search_result, base = searched.confirmed.search, searched.baseline
    if searched.refused:
        return remnant_block.not_testable("The baseline does not describe the drive.")
    if any(cause.effect.intermittent for cause in search_result.named):
        return remnant_block.not_testable(
            "The pedal stands still between decisions: its innovations have no law."
        )
    effects = tuple(effect for effect in base.corrected.settings.catalogue if effect.kind is Kind.REMNANT)
    left = innovations(base.prepared.trace, search_result.data, search_result.solved)
    tried = len(base.drivers) + len(effects)
    return remnant_block.diagnose_remnant(left, effects, held_out.dealt(search_result.data), tried)


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
    percent, sd = fit_quality(data.output.y, out, data.output.usable & ~data.output.hidden)
    shown = np.minimum(np.maximum(out, 0.0) if data.pedal else out, data.output.ceiling)
    form = baseline_form.stated(data, solved, why_form)
    return Fit(driver_intervals.channels(solved, dt, fitted, others), percent, shown, sd, form)


def _findings(
    confirmed: Confirmed[DriverData, DriverModel],
    trace: Trace,
    data: DriverData,
    held: Adequacy,
    gained: Gained,
) -> tuple[Finding, ...]:
    search_result = confirmed.search
    fitted = driver_intervals.parameters(search_result.solved, search_result.data)
    seconds = float((data.output.usable.sum()) * data.output.dt)
    in_unit = partial(in_output_unit, pedal=data.pedal)

    def rival(solved: FittedDriver, effect: Effect) -> Mapping[str, Interval]:
        return driver_intervals.parameters(solved, search_result.data, effect.id)[effect.id]

    out = []
    for cause in search_result.named:
        estimates = dict(fitted.get(cause.effect.id, {}))
        if cause.estimate is not None:
            estimates = {cause.effect.parameters[0].name: cause.estimate}
        if cause.episodes and Detector.PEDAL_CEILING not in cause.effect.detectors:
            estimates = driver_intervals.episode_parameters(cause, seconds)
        named = cause._replace(rivals=possible(cause.rivals, trace, data))
        score = confirmed.log_scores[cause.effect.id]
        out.append(finding(named, estimates, held, gained, score, rival, in_unit))
    return tuple(out)


def _limit_of_record(stated: Finding, corrected: Corrected) -> Finding:
    """A pedal's ceiling beyond which the car accelerates on is one of its record; where the car does not show it, either."""
    given, level = corrected.trace, stated.parameters.get("level")
    if stated.effect not in pedal_record.CEILINGS or level is None:
        return stated
    recorded = pedal_record.ends(given.t - given.t[0], corrected.context.vehicle.left, stated.episodes)
    if recorded is None:
        return stated._replace(rivals=(*stated.rivals, pedal_record.END_OF_RECORD))
    says = (
        f"The pedal's record ends at {number(level.value)} %: the car accelerates on while it stands there."
    )
    return stated._replace(where="sensing", says=says) if recorded else stated


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


def _advice(
    undecided: list[NotTestable], findings: tuple[Finding, ...], drivers: tuple[Effect, ...]
) -> list[str]:
    by = {effect.id: effect for effect in drivers}
    rivals = [
        f"{readable(f.effect)}: {by[f.effect].decides}" for f in findings if f.rivals and by[f.effect].decides
    ]
    return rivals + [
        f"{either(n.effects)}: {by[n.effects[0]].decides}" for n in undecided if by[n.effects[0]].decides
    ]
