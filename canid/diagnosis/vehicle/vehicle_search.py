"""Search for the vehicle's effects: forward selection, then effects that have become superfluous are dropped."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from canid.diagnosis.fitting.candidates import (
    MIN_EXPLAINED,
    Candidate,
    best_fit,
    needed_still,
    price,
    screened,
)
from canid.diagnosis.fitting.robust_covariance import needed
from canid.diagnosis.fitting.search import RIVAL, Named, Option, Step, forward_selection
from canid.diagnosis.vehicle.vehicle_data import LEVEL_SLOPE_PERCENT, VehicleData
from canid.diagnosis.vehicle.vehicle_fit import FittedVehicle
from canid.diagnosis.vehicle.vehicle_model import STRENGTH, VehicleModel
from canid.effects.effect import DriveFeatures, Effect, Screening
from canid.types import Array

# of what the cause explains: no car follows a formula exactly, and a cause with an approximate form must not lose its
# name to a neighbour
RIVAL_MARGIN_SHARE = 0.25
# of each fit of a candidate
CANDIDATE_FIT_TURNS = 2

VehicleCandidate = Candidate[VehicleModel]


class VehicleSearch(NamedTuple):
    """What the search found."""

    baseline: FittedVehicle
    solved: FittedVehicle
    named: tuple[Named, ...]
    steps: tuple[Step, ...]


def starts(effect: Effect, data: VehicleData, without: FittedVehicle) -> list[Array]:
    """Initial guesses of an effect's own parameters."""
    known = features(data, without)
    own = [parameter.guesses(known) for parameter in effect.parameters]
    return [np.array(values) for values in product(*own)]


def features(data: VehicleData, fitted: FittedVehicle) -> DriveFeatures:
    """Features of the drive that effects on the vehicle depend on; power is that of a fitted car."""
    asked = fitted.q[STRENGTH] * data.seen.pedal * data.seen.speed
    return DriveFeatures(
        power=asked[fitted.rows],
        slope_sd=data.slope_sd,
        level=data.slope_sd <= LEVEL_SLOPE_PERCENT,
        gear_measured=data.geared,
    )


def candidates(
    effects: tuple[Effect, ...], data: VehicleData, without: FittedVehicle
) -> list[VehicleCandidate]:
    """Fit every effect that is not in the model yet and explains something along its direction."""
    out = []
    have = {effect.id for effect in without.model.effects}
    for effect in effects:
        if effect.id in have:
            continue
        guesses = [np.concatenate([without.q, p]) for p in starts(effect, data, without)]
        if effect.screening is not Screening.NONE:
            found = screened(effect, data, without, guesses)
            guesses = [guess.q for guess in found if guess.explains >= MIN_EXPLAINED]
        if guesses:
            best = best_fit(effect, data, without, guesses, CANDIDATE_FIT_TURNS)
            out.append(price(effect, best, without, data.output.dt))
    return out


def search_vehicle(data: VehicleData, effects: tuple[Effect, ...], baseline: FittedVehicle) -> VehicleSearch:
    """Find the effects.

    Args:
        data: what is explained.
        effects: those that may be found.
        baseline: the car without any.
    """
    m = len(effects)

    def propose(solved: FittedVehicle, step: int) -> tuple[FittedVehicle, list[Option[VehicleCandidate]]]:
        return solved, [
            Option(Step(one.effect, step, one.evidence, needed(one.parameters, m)), one)
            for one in candidates(effects, data, solved)
        ]

    def accept(_: FittedVehicle, option: Option[VehicleCandidate]) -> tuple[FittedVehicle, bool]:
        return option.found.solved, True

    solved, steps = forward_selection(baseline, propose, accept)
    kept = needed_still(data, solved, m, least=0)
    solved, have = kept.solved, {effect.id for effect in kept.solved.model.effects}
    named = []
    for effect in solved.model.effects:
        without = kept.without[effect.id]
        swaps = candidates(tuple(e for e in effects if e.id not in have), data, without)
        margin = max(RIVAL, RIVAL_MARGIN_SHARE * (without.deviance - solved.deviance))
        swaps = sorted(swaps, key=lambda one: -one.evidence)
        close = tuple(one.effect.id for one in swaps if one.solved.deviance - solved.deviance < margin)
        rivals = tuple(r for r in dict.fromkeys((*effect.rivals, *close)) if r not in have)
        named.append(Named(effect, kept.evidence[effect.id], needed(len(effect.parameters), m), rivals))
    return VehicleSearch(baseline, solved, tuple(named), steps)
