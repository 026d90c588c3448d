"""Candidates of the search: screened along their direction, then fitted in full."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from itertools import product

import numpy as np

from canid.models.diagnosis.driver import local_minima
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import (
    DESIRED,
    K1,
    K2,
    OFFSET,
    DriverModel,
)
from canid.models.diagnosis.fitting.candidates import (
    MIN_EXPLAINED,
    POLISH_EVIDENCE,
    Candidate,
    Guess,
    best_fit,
    is_operating_point,
    price,
    screened,
    simulates_worse,
)
from canid.models.diagnosis.fitting.fitted_model import extended, polished
from canid.models.diagnosis.fitting.model import RecentValues
from canid.models.effects.effect import DriveFeatures, Effect, Kind, Screening
from canid.values.types import Array

# quantiles of the headway at which a desired one is tried, where an effect makes it identifiable: a driver with a wide
# dead zone drives at its edge
DESIRED_QUANTILES = (0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98)
# and where it is the middle of a dead zone: the likelihood has steps along its edges
ZONE_QUANTILES = (0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98)
# at most so many candidates are fitted in full per step
MAX_FULL_FITS = 9
# and from so many starts where the cost has several local minima
MAX_STARTS = 2
# times what its best initial guess explains, that the fit of an effect finds at most
FITTED_OVER_SCREENED = 4.0
# and of what a few steps from the grid of delays explain, which have not come to their end
FITTED_OVER_ROUGH = 8.0
# of the best one's evidence, from which on another candidate is polished as well
POLISH_SHARE = 0.4


DriverCandidate = Candidate[DriverModel]


def starts(effect: Effect, data: DriverData, without: FittedDriver) -> Iterator[Array]:
    """Parameters at which a cause may begin: the model without it, and the cause's own."""
    free = data.output.usable & ~data.output.below
    base = without.q
    known = DriveFeatures(
        data.seen.duration, data.seen.speed[free], data.output.y[free], gap=data.seen.gap[free]
    )
    guesses = [parameter.guesses(known) for parameter in effect.parameters]
    quantiles = DESIRED_QUANTILES if effect.headway is None else ZONE_QUANTILES
    desired = (
        [float(x) for x in np.quantile(data.seen.headway[free], quantiles)]
        if effect.shows_desired_headway and not without.model.centred
        else [float(base[DESIRED])]
    )
    for headway, values in product(desired, product(*guesses)):
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
        local_minima.minima(extended(without.model, effect), data, without, q), key=lambda fit: fit.deviance
    ).q
    return best


def may_reach(effect: Effect, data: DriverData, without: FittedDriver, least: float) -> bool:
    """Whether an effect that its direction does not show may have so much evidence: a few steps from the grid of delays say.

    Of 30 fits of a response to the lead's acceleration with evidence above 4 (6 min, seeds from 6300000) none reached 4.4
    times the better of its direction and these steps.
    """
    q = np.r_[without.q, 0.5 * without.q[K2]]
    rough = local_minima.rough_fits(extended(without.model, effect), data, without, q)
    return without.deviance - rough[0].deviance > least / FITTED_OVER_ROUGH


def screen(effect: Effect, data: DriverData, without: FittedDriver) -> list[Guess]:
    """Price every initial guess by what its direction explains of the residual; the best first.

    A guess far from the model without it is priced by its gains, fitted anew, as well: a direction is the first step only.
    """
    model = extended(without.model, effect)
    begins: Iterable[Array] = starts(effect, data, without)
    for k in local_minima.change_points(model, effect):
        begins = local_minima.at_best_times(model, data, without, list(begins), k)
    out = screened(effect, data, without, begins)
    if all(each.pedal is None for each in model.effects):
        # every guess, and what its gains explain, one after the other
        recent = RecentValues()
        out = [
            begin
            for guess in out
            for begin in (guess, local_minima.regained(model, data, without, guess.q, recent))
        ]

    return sorted(out, key=lambda guess: -guess.explains)


def tried(effect: Effect, data: DriverData, without: FittedDriver, guesses: list[Guess]) -> DriverCandidate:
    """Fit a candidate in full, from its best initial guesses."""
    points: dict[tuple[float, ...], Array] = {}
    for guess in guesses:
        # one with other gains is no other start
        points.setdefault((guess.q[DESIRED], *guess.q[without.q.size :]), guess.q)
    some = list(points.values())[: MAX_STARTS if effect.shows_desired_headway else 1]
    if effect.shortens_dead_time:
        some.append(with_longer_delays(effect, data, without))
    best = best_fit(effect, data, without, some)
    best = local_minima.refined(data, best)
    if without.deviance - best.deviance > MIN_EXPLAINED:
        best = local_minima.at_best_edges(data, best, effect)
    return price(effect, best, without, data.output.dt)


def candidates(
    effects: tuple[Effect, ...], data: DriverData, without: FittedDriver, least: float = 0.0
) -> list[DriverCandidate]:
    """Try every cause that is not in the model yet; best first.

    Args:
        effects: the causes.
        data: the driver's columns.
        without: the model.
        least: evidence below which a candidate is of no use.
    """
    have = {effect.id for effect in without.model.effects}
    screened = [
        (effect, screen(effect, data, without))
        for effect in effects
        if effect.kind is Kind.PARAMETRIC and effect.id not in have
    ]
    screened.sort(key=lambda pair: (pair[0].screening is not Screening.NONE, -pair[1][0].explains))
    promising = max(MIN_EXPLAINED, least / FITTED_OVER_SCREENED)
    worth = [
        (effect, begins)
        for effect, begins in screened
        if begins[0].explains > promising
        or (effect.screening is Screening.NONE and (least <= 0 or may_reach(effect, data, without, least)))
    ][:MAX_FULL_FITS]
    fitted = [tried(effect, data, without, begins) for effect, begins in worth]
    best = max((least, *(candidate.evidence for candidate in fitted)))
    worth_polish = max(POLISH_EVIDENCE, POLISH_SHARE * best)
    refined = [
        price(candidate.effect, polished(data, candidate.solved), without, data.output.dt)
        if candidate.evidence > worth_polish
        else candidate
        for candidate in fitted
    ]

    @cache
    def other(effect: Effect) -> DriverCandidate:
        return tried(effect, data, without, screen(effect, data, without))

    return [
        candidate
        for candidate in refined
        if candidate.evidence >= least
        and not simulates_worse(data, candidate.solved, without)
        and not is_operating_point(candidate, without, other)
    ]
