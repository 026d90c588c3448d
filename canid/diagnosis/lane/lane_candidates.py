"""Candidates of lane keeping: screened along their direction and by their gains, then fitted in full."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from canid.diagnosis.driver.driver_candidates import (
    EVIDENCE_PER_PARAMETER,
    MAX_STARTS,
    POLISH_EVIDENCE,
    TIMELESS_SHARE,
    simulates_worse,
)
from canid.diagnosis.fitting.candidates import MIN_EXPLAINED, Candidate, Guess, best_fit, price, screened
from canid.diagnosis.fitting.fitted_model import extended, polished
from canid.diagnosis.fitting.likelihood import whitened
from canid.diagnosis.fitting.search import RIVAL
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.diagnosis.lane.lane_model import (
    KD,
    OFFSET,
    PRODUCT,
    TAU,
    WANTED,
    K,
    LaneModel,
    parts,
    second_order,
)
from canid.effects.effect import DriveFeatures, Effect, Kind
from canid.types import Array

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
    own = [parameter.guesses(known) for parameter in effect.parameters]
    wanted = [float(base[WANTED])]
    if effect.shows_desired_headway and not without.model.centred:
        wanted = [float(x) for x in np.quantile(data.offset[free], WANTED_QUANTILES)]
    for position, values in product(wanted, product(*own)):
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
    dt, noise, of = data.output.dt, without.noise, parts(model, data, q)

    def through(x: Array | float) -> Array:
        return second_order(x + np.zeros(data.t.size), float(q[TAU]), float(q[PRODUCT]), dt)

    rows = without.rows
    columns = [np.ones(data.t.size), through(of.gain * of.position), through(of.gain * of.rate)]
    X = whitened(noise, np.stack(columns, axis=1))[rows]
    y = whitened(noise, data.output.y - through(of.added))[rows]
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
    found = price(
        effect,
        best_fit(effect, data, without, [one.q for one in guesses[:MAX_STARTS]]),
        without,
        data.output.dt,
    )
    if found.evidence < POLISH_EVIDENCE:
        return found
    return price(effect, polished(data, found.solved), without, data.output.dt)


def candidates(effects: tuple[Effect, ...], data: LaneData, without: FittedLane) -> list[LaneCandidate]:
    """Try every cause that is not in the model yet."""
    have = {effect.id for effect in without.model.effects}
    found = [tried(effect, data, without) for effect in effects if effect.id not in have]
    return [
        one
        for one in found
        if one is not None
        and not simulates_worse(data, one.solved, without)
        and not is_operating_point(one, data, without)
    ]


def is_operating_point(one: LaneCandidate, data: LaneData, without: FittedLane) -> bool:
    """Does the same freedom, given to the speed, explain as much as this dependence on time? As in car following."""
    if one.evidence < POLISH_EVIDENCE:
        return False
    won = without.deviance - one.solved.deviance
    for effect in one.effect.timeless:
        other = tried(effect, data, without)
        if other is None:
            continue
        handicap = EVIDENCE_PER_PARAMETER * max(other.parameters - one.parameters, 0)
        if without.deviance - other.solved.deviance - handicap > min(won - RIVAL, TIMELESS_SHARE * won):
            return True
    return False
