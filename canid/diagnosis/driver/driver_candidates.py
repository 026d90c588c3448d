"""Candidates of the search: screened along their direction, then fitted in full."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from canid.diagnosis.driver import change_point, delay_grid
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_model import (
    DESIRED,
    K1,
    K2,
    OFFSET,
    DriverModel,
)
from canid.diagnosis.driver.recent_values import RecentValues
from canid.diagnosis.fitting.candidates import MIN_EXPLAINED, Candidate, Guess, best_fit, price, screened
from canid.diagnosis.fitting.fitted_model import FittedModel, M, extended, polished
from canid.diagnosis.fitting.model import Columns
from canid.diagnosis.fitting.search import RIVAL
from canid.effects.effect import DriveFeatures, Effect, Kind, Screening
from canid.types import Array

# quantiles of the headway at which a desired one is tried, where an effect makes it identifiable: a driver with a wide
# dead zone drives at its edge
DESIRED_QUANTILES = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98)
# at most so many candidates are fitted in full per step
MAX_FULL_FITS = 9
# and from so many starts where the cost has several local minima
MAX_STARTS = 2
# evidence from which on a candidate may win, and its fit is polished
POLISH_EVIDENCE = 8.0
# of the best one's evidence, from which on another candidate is polished as well
POLISH_SHARE = 0.4
# evidence per parameter: of two candidates, the one with more of them must explain more by so much
EVIDENCE_PER_PARAMETER = 6.0
# of the evidence of a dependence on time, that one on the operating point may not reach: neither has the exact form of
# the driver's law, so the better of two approximations may be the wrong one
TIMELESS_SHARE = 0.5
# of the simulation's error variance, that a likelier model may lose on the data that it is fitted to
MAX_SIMULATION_LOSS = 0.25
# of the simulation's error variance on held-out data; a quick cause may make a slow simulation worse by so much and
# still predict better
MAX_SLOW_LOSS = 0.05


DriverCandidate = Candidate[DriverModel]


def starts(effect: Effect, data: DriverData, without: FittedDriver) -> Iterator[Array]:
    """Parameters at which a cause may begin: the model without it, and the cause's own."""
    free = data.output.usable & ~data.output.below
    base = without.q
    known = DriveFeatures(
        data.seen.duration, data.seen.speed[free], data.output.y[free], gap=data.seen.gap[free]
    )
    own = [parameter.guesses(known) for parameter in effect.parameters]
    desired = (
        [float(x) for x in np.quantile(data.seen.headway[free], DESIRED_QUANTILES)]
        if effect.shows_desired_headway and not without.model.centred
        else [float(base[DESIRED])]
    )
    for headway, values in product(desired, product(*own)):
        q = np.r_[base, values]
        q[OFFSET] += q[K1] * (headway - q[DESIRED])
        q[DESIRED] = headway
        yield q


def with_longer_delays(effect: Effect, data: DriverData, without: FittedDriver) -> Array:
    """Initial guess for an effect that looks like a shorter delay to the model without it.

    That model has found the short delay, and from there the likelihood falls on the way to the true one.
    """
    q = np.r_[without.q, 0.5 * without.q[K2]]
    best: Array = min(
        delay_grid.minima(extended(without.model, effect), data, without, q), key=lambda one: one.deviance
    ).q
    return best


def screen(effect: Effect, data: DriverData, without: FittedDriver) -> list[Guess]:
    """Price every initial guess by what its direction explains of the residual; the best first.

    A guess far from the model without it is priced by its gains, fitted anew, as well: a direction is the first step only.
    """
    model = extended(without.model, effect)
    out = screened(effect, data, without, starts(effect, data, without))
    if all(each.pedal is None for each in model.effects):
        # every guess, and what its gains explain, one after the other
        recent = RecentValues()
        out = [
            one
            for guess in out
            for one in (guess, delay_grid.regained(model, data, without, guess.q, recent))
        ]

    return sorted(out, key=lambda guess: -guess.explains)


def tried(effect: Effect, data: DriverData, without: FittedDriver, guesses: list[Guess]) -> DriverCandidate:
    """Fit a candidate in full, from its best initial guesses."""
    some = [guess.q for guess in guesses[: MAX_STARTS if effect.shows_desired_headway else 1]]
    if effect.shortens_dead_time:
        some.append(with_longer_delays(effect, data, without))
    best = best_fit(effect, data, without, some)
    return price(effect, change_point.refined(data, best), without, data.output.dt)


def candidates(effects: tuple[Effect, ...], data: DriverData, without: FittedDriver) -> list[DriverCandidate]:
    """Try every cause that is not in the model yet; best first."""
    have = {effect.id for effect in without.model.effects}
    screened = [
        (effect, screen(effect, data, without))
        for effect in effects
        if effect.kind is Kind.PARAMETRIC and effect.id not in have
    ]
    screened.sort(key=lambda pair: (pair[0].screening is not Screening.NONE, -pair[1][0].explains))
    worth = [
        pair
        for pair in screened
        if pair[1][0].explains > MIN_EXPLAINED or pair[0].screening is Screening.NONE
    ][:MAX_FULL_FITS]
    found = [tried(effect, data, without, begins) for effect, begins in worth]
    least = max(POLISH_EVIDENCE, POLISH_SHARE * max((one.evidence for one in found), default=0.0))
    refined = [
        price(one.effect, polished(data, one.solved), without, data.output.dt)
        if one.evidence > least
        else one
        for one in found
    ]
    others: dict[str, DriverCandidate] = {}
    return [
        one
        for one in refined
        if not simulates_worse(data, one.solved, without)
        and not is_operating_point(one, data, without, others)
    ]


def is_operating_point(
    one: DriverCandidate, data: DriverData, without: FittedDriver, others: dict[str, DriverCandidate]
) -> bool:
    """Does the same freedom, given to the operating point, explain as much as this dependence on time?

    A time-invariant driver behind a lead that changes its speed changes with the operating point alone.

    Args:
        one: the dependence on time.
        data: what is explained.
        without: the model without it.
        others: what was tried in its place before; is added to.
    """
    if one.evidence < POLISH_EVIDENCE:
        return False
    won = without.deviance - one.solved.deviance
    for effect in one.effect.timeless:
        if effect.id not in others:
            others[effect.id] = tried(effect, data, without, screen(effect, data, without))
        other = others[effect.id]
        handicap = EVIDENCE_PER_PARAMETER * max(other.parameters - one.parameters, 0)
        if without.deviance - other.solved.deviance - handicap > min(won - RIVAL, TIMELESS_SHARE * won):
            return True
    return False


def simulates_worse(data: Columns, one: FittedModel[M], without: FittedModel[M]) -> bool:
    """Does a model that predicts the next sample better simulate the drive worse than the model without the cause?

    Then it has traded the slow part of the response for the noise model, which explains any slow part: on measured
    drives such fits have gains of ten times the baseline's, and an error variance of up to forty times. The driver's own
    noise is in the inputs through the loop, so the true model may simulate a little worse than a wrong one (by 11 % where
    an IDM driver has K1 0.60 and a constant time headway takes 0.07): a small loss says nothing.
    """
    free = data.output.usable & ~data.output.hidden
    square = [float(np.mean((data.output.y - of.fitted.model)[free] ** 2)) for of in (without, one)]
    return square[1] > (1 + MAX_SIMULATION_LOSS) * square[0]
