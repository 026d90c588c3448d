"""Which causes the car needs: one after another, refitted jointly, dropped again where others have made them superfluous."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from canid.diagnosis.evidence import needed
from canid.diagnosis.vehicle_data import VehicleData
from canid.diagnosis.vehicle_fit import SolvedCar, direction, inflation, solve
from canid.effects.cause import Effect
from canid.types import Array

# causes at once: more have never been needed, and each further one costs a fit of all others
MOST = 4
# a candidate whose direction explains less than this is not fitted
WORTH = 3.0
# of the deviance: a cause whose fit is worse by less explains the same as well (odds of 20 to 1)
RIVAL = 6.0
# of what the cause explains: cars follow no formula, and a cause whose own form is a little off must not lose its name
# to a neighbour
FORM = 0.25


class CarStep(NamedTuple):
    """One candidate at one step."""

    effect: Effect
    step: int
    evidence: float
    needed: float
    accepted: bool


class NamedCause(NamedTuple):
    """One cause in the model."""

    effect: Effect
    evidence: float
    needed: float
    rivals: tuple[str, ...]


class CarSearch(NamedTuple):
    """What the search found."""

    before: SolvedCar
    solved: SolvedCar
    named: tuple[NamedCause, ...]
    steps: tuple[CarStep, ...]


class Candidate(NamedTuple):
    """One cause added to a model."""

    effect: Effect
    solved: SolvedCar
    evidence: float


def starts(effect: Effect, data: VehicleData, without: SolvedCar) -> list[Array]:
    """Parameters at which a cause may begin."""
    own = [parameter.starts for parameter in effect.parameters]
    if effect.id == "power_limit":
        # a limit acts where strength × pedal × speed is largest
        asked = without.fitted.q[0] * data.seen.pedal * data.seen.speed
        own = [tuple(float(x) for x in np.quantile(asked[without.rows], (0.7, 0.9, 0.97)))]
    if effect.id == "road_grade":
        own = [(data.slope_sd,)]
    return [np.array(values) for values in product(*own)]


def candidates(effects: tuple[Effect, ...], data: VehicleData, without: SolvedCar) -> list[Candidate]:
    """Fit every cause that is not in the model yet and explains something along its direction; best first."""
    out = []
    have = {effect.id for effect in without.model.effects}
    for effect in effects:
        if effect.id in have:
            continue
        best: SolvedCar | None = None
        for p in starts(effect, data, without):
            d, e = direction(without, data, effect, p), without.fitted.scored.e
            size = float(d @ d)
            # a slope is as slow as the noise that stands in for it while it is not in the model: whitening hides it
            if effect.id != "road_grade" and (size < 1e-9 or float(d @ e) ** 2 / size < WORTH):
                continue
            q = np.concatenate([without.fitted.q, p])
            solved = solve(data, (*without.model.effects, effect), q, without.noise, without.rows, turns=2)
            if best is None or solved.deviance < best.deviance:
                best = solved
        if best is not None:
            out.append(Candidate(effect, best, _evidence(effect, best, without, data.output.dt)))
    return sorted(out, key=lambda candidate: -candidate.evidence)


def _evidence(effect: Effect, solved: SolvedCar, without: SolvedCar, dt: float) -> float:
    where = solved.model.where[[e.id for e in solved.model.effects].index(effect.id)]
    gained = max(without.deviance - solved.deviance, 0.0)
    return gained / inflation(solved, range(where.start, where.stop), dt)


def _dropped(data: VehicleData, solved: SolvedCar, effect: Effect) -> SolvedCar:
    kept = [
        (e, w) for e, w in zip(solved.model.effects, solved.model.where, strict=True) if e.id != effect.id
    ]
    base = solved.fitted.q[: solved.model.where[0].start]
    q = np.concatenate([base, *(solved.fitted.q[w] for _, w in kept)])
    return solve(data, [e for e, _ in kept], q, solved.noise, solved.rows)


def search_car(data: VehicleData, effects: tuple[Effect, ...], before: SolvedCar) -> CarSearch:
    """Find the causes.

    Args:
        data: what is explained.
        effects: causes that may be found.
        before: the baseline.
    """
    solved, steps, m, dt = before, [], len(effects), data.output.dt
    for step in range(1, MOST + 1):
        tried = candidates(effects, data, solved)
        bound = {c.effect.id: needed(len(c.effect.parameters), m) for c in tried}
        won = bool(tried) and tried[0].evidence > bound[tried[0].effect.id]
        steps += [
            CarStep(c.effect, step, c.evidence, bound[c.effect.id], won and k == 0)
            for k, c in enumerate(tried)
        ]
        if not won:
            break
        solved = tried[0].solved
    named: list[NamedCause] = []
    while solved.model.effects:
        without = {effect.id: _dropped(data, solved, effect) for effect in solved.model.effects}
        priced = {
            effect.id: _evidence(effect, solved, without[effect.id], dt) for effect in solved.model.effects
        }
        weakest = min(
            solved.model.effects, key=lambda effect: priced[effect.id] - needed(len(effect.parameters), m)
        )
        if priced[weakest.id] <= needed(len(weakest.parameters), m):
            solved = without[weakest.id]
            continue
        for effect in solved.model.effects:
            swaps = candidates(tuple(e for e in effects if e.id not in priced), data, without[effect.id])
            margin = max(RIVAL, FORM * (without[effect.id].deviance - solved.deviance))
            close = tuple(c.effect.id for c in swaps if c.solved.deviance - solved.deviance < margin)
            rivals = tuple(r for r in dict.fromkeys((*effect.rivals, *close)) if r not in priced)
            named.append(NamedCause(effect, priced[effect.id], needed(len(effect.parameters), m), rivals))
        break
    return CarSearch(before, solved, tuple(named), tuple(steps))
