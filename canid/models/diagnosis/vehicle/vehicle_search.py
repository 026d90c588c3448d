"""The car's baseline, and the search for its effects: forward selection, then superfluous effects are dropped."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.fitting import fitted_model
from canid.models.diagnosis.fitting.candidates import (
    MIN_EXPLAINED,
    Candidate,
    best_fit,
    needed_still,
    price,
    screened,
)
from canid.models.diagnosis.fitting.fitted_model import FittedModel, Start, solve, without_parameters
from canid.models.diagnosis.fitting.search import RIVAL, Named, Option, Step, forward_selection
from canid.models.diagnosis.fitting.uncertainty import needed, sandwich
from canid.models.diagnosis.vehicle.vehicle_data import LEVEL_SLOPE_PERCENT, VehicleData
from canid.models.diagnosis.vehicle.vehicle_model import LAG, STRENGTH, VehicleModel, with_effects
from canid.models.effects.effect import DriveFeatures, Effect, Screening
from canid.values.types import Array

FittedVehicle = FittedModel[VehicleModel]

# a middle-class car: strength m/s² per %, lag s, rolling m/s², drag 1/m
INITIAL = (0.04, 0.35, 0.2, 3e-4)
# the noise model that accelerations mostly have, and its standard deviation in parts of the output's
INITIAL_A, INITIAL_SD = (1.0, -0.9), 0.3
# samples: 40 s at 10 Hz
MIN_SAMPLES = 400


def baseline(data: VehicleData) -> FittedVehicle | None:
    """Fit the car without any effect; None: too few samples."""
    y, usable = data.output.y, data.output.usable
    if int(np.count_nonzero(usable)) < MIN_SAMPLES:
        return None
    sd = max(float(np.std(y[usable])) * INITIAL_SD, 1e-6)
    start = Start([np.array(INITIAL)], np.array(INITIAL_A), sd, rounds=1, turns=2, min_rows=MIN_SAMPLES)
    return fitted_model.baseline(data, with_effects(()), start)


def standard_errors(solved: FittedVehicle, dt: float) -> Array:
    """Standard deviations of the parameters (k,): the sandwich, nowhere narrower than the likelihood's."""
    out: Array = np.sqrt(np.diag(sandwich(solved.fitted, dt).C))
    return out


# of what the cause explains: no car follows a formula exactly, and a cause with an approximate form must not lose its
# name to a neighbour
RIVAL_MARGIN_SHARE = 0.25

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
    guesses = [parameter.guesses(known) for parameter in effect.parameters]
    return [np.array(values) for values in product(*guesses)]


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
            guessed = screened(effect, data, without, guesses)
            guesses = [guess.q for guess in guessed if guess.explains >= MIN_EXPLAINED]
        if guesses:
            best = best_fit(effect, data, without, guesses)
            out.append(price(effect, best, without, data.output.dt))
    return out


def again(effect: Effect, data: VehicleData, without: FittedVehicle) -> FittedVehicle:
    """Search one effect's parameters on the rows of a model without it; that model, where its direction explains nothing."""
    fits = candidates((effect,), data, without)
    return fits[0].solved if fits else without


def _own_lag(data: VehicleData, solved: FittedVehicle, tried: int) -> FittedVehicle:
    """The model without a further lag that only stands for the car's own.

    Before the road's slope is known the car's lag may be fitted at 0, from which no later fit leaves; the lag that is added
    then is the car's. So the model without it is fitted from where the car has both.
    """
    for effect, where in zip(solved.model.effects, solved.model.where, strict=True):
        if effect.vehicle is None or effect.vehicle.lag is None:
            continue
        model, q = without_parameters(solved, effect.id)
        q[LAG] = min(q[LAG] + float(solved.q[where.start]), float(model.high[LAG]))
        alone = solve(data, model, q, solved.noise, solved.rows)
        priced = price(effect, solved, alone, data.output.dt)
        if priced.evidence < needed(priced.parameters, tried):
            return _own_lag(data, alone, tried)
    return solved


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
            Option(
                Step(candidate.effect, step, candidate.evidence, needed(candidate.parameters, m)), candidate
            )
            for candidate in candidates(effects, data, solved)
        ]

    def accept(_: FittedVehicle, option: Option[VehicleCandidate]) -> tuple[FittedVehicle, bool]:
        return option.found.solved, True

    solved, steps = forward_selection(baseline, propose, accept)
    kept = needed_still(data, _own_lag(data, solved, m), m)
    solved, have = kept.solved, {effect.id for effect in kept.solved.model.effects}
    named = []
    for effect in solved.model.effects:
        without = kept.without[effect.id]
        swaps = candidates(tuple(e for e in effects if e.id not in have), data, without)
        margin = max(RIVAL, RIVAL_MARGIN_SHARE * (without.deviance - solved.deviance))
        swaps = sorted(swaps, key=lambda candidate: -candidate.evidence)
        close = {c.effect.id: c.solved for c in swaps if c.solved.deviance - solved.deviance < margin}
        rivals = tuple(r for r in dict.fromkeys((*effect.rivals, *close)) if r not in have)
        bound = needed(len(effect.parameters), m)
        named.append(Named(effect, kept.evidence[effect.id], bound, rivals, in_place=close))
    return VehicleSearch(baseline, solved, tuple(named), steps)
