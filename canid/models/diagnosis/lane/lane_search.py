"""Search for the causes of a driver who keeps the lane, and which ones the drive cannot show."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from canid.mathematics.identification import movement_rhythm
from canid.models.diagnosis.driver import detectability, pedal_holds
from canid.models.diagnosis.driver.driver_candidates import MAX_STARTS
from canid.models.diagnosis.driver.driver_search import (
    FORM_EVIDENCE_SHARE,
    START_CHANCES,
    CauseSearch,
    selected,
    with_curve,
    with_holds,
)
from canid.models.diagnosis.driver.model_averaging import Alternative, alternative
from canid.models.diagnosis.driver.pedal_holds import Holds
from canid.models.diagnosis.fitting.candidates import (
    MIN_EXPLAINED,
    POLISH_EVIDENCE,
    Candidate,
    Guess,
    at_bound,
    best_fit,
    direction,
    is_operating_point,
    model_directions,
    price,
    screened,
    simulates_worse,
)
from canid.models.diagnosis.fitting.fitted_model import extended, polished, rescaled
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.diagnosis.fitting.search import Option, Step
from canid.models.diagnosis.fitting.uncertainty import needed
from canid.models.diagnosis.lane.lane_fit import FittedLane
from canid.models.diagnosis.lane.lane_model import (
    KD,
    OFFSET,
    PRODUCT,
    TAU,
    WANTED,
    K,
    LaneData,
    LaneModel,
    parts,
    second_order,
)
from canid.models.effects.effect import Detector, DriveFeatures, Effect, Kind
from canid.values.findings import NotTestable
from canid.values.text.names import readable
from canid.values.types import Array

LaneCandidate = Candidate[LaneModel]

# quantiles of the offset at which the wanted position is tried, where an effect makes it identifiable
WANTED_QUANTILES = (0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9)


def searchable(effects: tuple[Effect, ...], data: LaneData) -> tuple[Effect, ...]:
    """Effects that are fitted on this drive."""
    return tuple(
        effect
        for effect in effects
        if effect.kind is Kind.PARAMETRIC
        and effect.identifiable
        and ("curvature" not in effect.needs or data.curvature is not None)
    )


def starts(effect: Effect, data: LaneData, without: FittedLane) -> Iterator[Array]:
    """Parameters at which a cause may begin: the model without it, and the cause's own."""
    base, free = without.q, data.output.usable
    known = DriveFeatures(data.duration, data.speed[free], data.output.y[free])
    guesses = [parameter.guesses(known) for parameter in effect.parameters]
    wanted = [float(base[WANTED])]
    if effect.shows_desired_headway and not without.model.centred:
        wanted = [float(x) for x in np.quantile(data.offset[free], WANTED_QUANTILES)]
    for position, values in product(wanted, product(*guesses)):
        q = np.r_[base, values]
        q[OFFSET] += q[K] * (position - q[WANTED])
        q[WANTED] = position
        yield q


def screen(effect: Effect, data: LaneData, without: FittedLane) -> list[Guess]:
    """Price every initial guess by what its direction explains, and by its gains fitted anew; the best first."""
    model = extended(without.model, effect)
    out = screened(effect, data, without, starts(effect, data, without))
    if all(each.pedal is None for each in model.effects):
        out += [regained(model, data, without, guess.q) for guess in list(out)]
    return sorted(out, key=lambda guess: -guess.explains)


def regained(model: LaneModel, data: LaneData, without: FittedLane, q: Array) -> Guess:
    """Fit gains and offset by linear least squares, everything else fixed."""
    dt, noise, entering = data.output.dt, without.noise, parts(model, data, q)

    def through(x: Array | float) -> Array:
        return second_order(x + np.zeros(data.t.size), float(q[TAU]), float(q[PRODUCT]), dt)

    rows = without.rows
    columns = [
        np.ones(data.t.size),
        through(entering.gain * entering.position),
        through(entering.gain * entering.rate),
    ]
    X = whitened(noise, np.stack(columns, axis=1))[rows]
    y = whitened(noise, data.output.y - through(entering.added))[rows]
    gains = np.linalg.lstsq(X, y, rcond=None)[0]
    left, before = y - X @ gains, without.fitted.scored.e[rows]
    q = q.copy()
    where = [OFFSET, K, KD]
    q[where] = np.clip(gains, model.low[where], model.high[where])
    return Guess(q, max(float(before @ before - left @ left), 0.0))


def tried(effect: Effect, data: LaneData, without: FittedLane) -> LaneCandidate | None:
    """Fit a candidate in full, from its best initial guesses; None: its direction explains nothing."""
    guesses = screen(effect, data, without)
    if not guesses or guesses[0].explains < MIN_EXPLAINED:
        return None
    priced = price(
        effect,
        best_fit(effect, data, without, [guess.q for guess in guesses[:MAX_STARTS]]),
        without,
        data.output.dt,
    )
    if priced.evidence < POLISH_EVIDENCE:
        return priced
    return price(effect, polished(data, priced.solved), without, data.output.dt)


def again(effect: Effect, data: LaneData, without: FittedLane) -> FittedLane:
    """Search one effect's parameters on the rows of a model without it; that model, where its direction explains nothing."""
    candidate = tried(effect, data, without)
    return without if candidate is None else candidate.solved


def candidates(effects: tuple[Effect, ...], data: LaneData, without: FittedLane) -> list[LaneCandidate]:
    """Try every cause that is not in the model yet."""
    have = {effect.id for effect in without.model.effects}
    fitted = [tried(effect, data, without) for effect in effects if effect.id not in have]
    return [
        candidate
        for candidate in fitted
        if candidate is not None
        and not simulates_worse(data, candidate.solved, without)
        and not is_operating_point(candidate, without, lambda effect: tried(effect, data, without))
    ]


LaneSearch = CauseSearch[LaneData, LaneModel]
Found = LaneCandidate | Holds


def search_causes(data: LaneData, effects: tuple[Effect, ...], fitted: FittedLane) -> LaneSearch:
    """Search, one cause after another.

    Args:
        data: the columns.
        effects: candidates.
        fitted: the baseline.
    """
    curves = searchable(effects, data)
    holding = [effect for effect in effects if Detector.PEDAL_HOLDS in effect.detectors]

    def propose(state: LaneSearch, step: int) -> tuple[LaneSearch, list[Option[Found]]]:
        if holding and not state.holds:
            seen = detect(state.data, state.solved)
            if seen.pattern is not None:
                held = Step(holding[0], step, seen.evidence, seen.needed)
                return state, [Option(held, seen, certain=True)]
        form = FORM_EVIDENCE_SHARE * sum(cause.evidence for cause in state.named)
        options = list[Option[Found]]()
        for candidate in candidates(curves, state.data, state.solved):
            bound = _needed(candidate, len(effects)) + form
            if not at_bound(candidate):
                options.append(Option(Step(candidate.effect, step, candidate.evidence, bound), candidate))
        return state, options

    def accept(state: LaneSearch, option: Option[Found]) -> tuple[LaneSearch, bool]:
        step, finding = option.step, option.found
        if isinstance(finding, Holds):
            return with_holds(state, step, finding), True
        return with_curve(state, step, finding, rescaled), True

    begin = LaneSearch(fitted, data, fitted, among=effects)
    return selected(begin, effects, curves, propose, accept, candidates)


def largest_margin(data: LaneData, fitted: FittedLane, effects: tuple[Effect, ...], among: int) -> float:
    """Largest evidence over what it needs, of all effects in the first step of a search; −inf: none is fitted.

    Args:
        data: the columns.
        fitted: the baseline.
        effects: that are tried.
        among: effects that are counted.
    """
    tried = candidates(searchable(effects, data), data, fitted)
    return max(
        (candidate.evidence - _needed(candidate, among) for candidate in tried if not at_bound(candidate)),
        default=-math.inf,
    )


def alternatives(data: LaneData, fitted: FittedLane, effects: tuple[Effect, ...]) -> tuple[Alternative, ...]:
    """Models with one effect each, with their odds against the baseline.

    Args:
        data: the columns.
        fitted: the baseline.
        effects: that are tried.
    """
    weighed = []
    for candidate in candidates(searchable(effects, data), data, fitted):
        # of several, the first is the gain
        strength = detectability.strength(candidate.effect) or candidate.effect.parameters[0]
        weighed.append(alternative(candidate, strength, WANTED + 1, data.output.dt, strength.typical or 1.0))
    return tuple(each for each in weighed if each is not None)


def _needed(candidate: LaneCandidate, among: int) -> float:
    return needed(
        candidate.parameters, among * (START_CHANCES if candidate.effect.shows_desired_headway else 1)
    )


def detect(data: LaneData, solved: FittedLane) -> Holds:
    """Find stretches in which the wheel is held although the model would turn it."""
    step = movement_rhythm.step_size(data.output.y[data.output.usable])
    spans, evidence = pedal_holds.episodes(pedal_holds.holding(data.output, solved, step), data.output.dt)
    if len(spans) < pedal_holds.MIN_EPISODES or evidence < pedal_holds.NEEDED_EVIDENCE:
        return pedal_holds.NONE
    return Holds(Detector.PEDAL_HOLDS, spans, float(evidence), np.nan)


def expected(effects: tuple[Effect, ...], data: LaneData, without: FittedLane) -> dict[str, float]:
    """Evidence of each effect that is fitted here, at its typical strength: effect id -> evidence."""
    out, Q = {}, model_directions(without)
    for effect in searchable(effects, data):
        begin = list(starts(effect, data, without))
        q = begin[len(begin) // 2].copy()
        q[without.q.size :] = [p.typical for p in effect.parameters]
        simulated = extended(without.model, effect).bind(data)(q)
        d = direction(data, without, Q, simulated - without.fitted.model)
        out[effect.id] = float(d @ d)
    return out


def undecided(effects: tuple[Effect, ...], evidence: dict[str, float], named: set[str]) -> list[NotTestable]:
    """Effects that this drive cannot show.

    Args:
        effects: candidates.
        evidence: from `expected`.
        named: those that were found.
    """
    out = []
    for effect in effects:
        if effect.kind is not Kind.PARAMETRIC or effect.id in named:
            continue
        tail = f"; what would decide: {effect.decides}" if effect.decides else ""
        bound = needed(len(effect.parameters), len(effects))
        if effect.id not in evidence:
            why = effect.absorbed or f"{', '.join(map(readable, effect.needs))} is not measured"
            out.append(NotTestable((effect.id,), why + tail))
        elif evidence[effect.id] < bound:
            at = ", ".join(f"{p.name} {p.typical:.2g} {p.unit}".removesuffix(" 1") for p in effect.parameters)
            why = "a typical strength of it leaves too little on this drive"
            expected_text = (
                f" (expected evidence {evidence[effect.id]:.0f} of the {bound:.0f} needed, at {at})"
            )
            out.append(NotTestable((effect.id,), why + expected_text + tail, evidence[effect.id], bound))
    return out
