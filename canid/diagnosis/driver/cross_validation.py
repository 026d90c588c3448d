"""Search with cross-validation: a cause must gain on held-out data, or the search is repeated without it.

The distribution of the evidence on the data that chose a cause assumes a known noise model. Held-out data need no such
assumption: a change point, a speed or a width chosen by chance explains nothing elsewhere. And a cause, weak or strong,
that makes the simulation of held-out data worse is not the cause.
"""

from __future__ import annotations

from typing import NamedTuple

from canid.diagnosis.driver import driver_search, held_out
from canid.diagnosis.driver.driver_candidates import MAX_SLOW_LOSS
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.driver.held_out import Fold
from canid.effects.effect import Effect, Kind
from canid.types import Interval

# times the needed evidence; above it no false cause was ever seen
SURE_RATIO = 2.5
# of its evidence that a cause must win on data that did not fit it; a true one wins nearly all of it
MIN_CARRIED_SHARE = 0.25


class Confirmed(NamedTuple):
    """A search, and the effects that it was made without."""

    search: Search
    folds: tuple[Fold, ...]  # both models, fitted to all but each fold
    gain: Interval  # of all its causes, on held-out data
    refused: tuple[str, ...]  # sentences


def search_causes(data: DriverData, effects: tuple[Effect, ...], fitted: FittedDriver) -> Confirmed:
    """Search until every cause that is named carries over.

    Args:
        data: the driver's columns.
        effects: candidates of the driver's block.
        fitted: the baseline.
    """
    refused: list[str] = []
    while True:
        search = driver_search.search_causes(data, effects, fitted)
        chance = _chance(search)
        if chance:
            why = "it explains nothing on held-out data"
        else:
            folds = held_out.folds(data, search)
            dt = data.output.dt
            gain = held_out.gain(*held_out.errors(data, search, folds), dt) if search.named else Interval()
            if not worse(gain, data, search, folds):
                return Confirmed(search, folds, gain, tuple(refused))
            chance, why = _weakest(search), "it makes the simulation of held-out data worse"
        refused.append(f"{chance} dropped: {why}")
        effects = tuple(effect for effect in effects if effect.id != chance)


def worse(gain: Interval, data: DriverData, search: Search, folds: tuple[Fold, ...]) -> bool:
    """Do the causes make the simulation of held-out data worse? Then they are not the causes.

    A small loss of the simulation does not count where the one-step predictions gain.
    """
    # a pedal that stands still at times is simulated by the same mean law: the next sample shows whether it helps
    if not gain.value < 0 or not (search.solved.model.effects or search.random_walk):
        return False
    if gain.value <= -MAX_SLOW_LOSS or gain.high < 0:
        return True
    errors = held_out.errors(data, search, folds, predicted_errors=True)
    return not held_out.gain(*errors, data.output.dt).low > 0


def _weakest(search: Search) -> str:
    return min(search.named, key=lambda one: one.evidence / one.needed).effect.id


def _chance(search: Search) -> str:
    """Id of the weakest cause that does not carry over; "" where all do."""
    fitted = {effect.id for effect in search.solved.model.effects if effect.kind is Kind.PARAMETRIC}
    for one in sorted(search.named, key=lambda one: one.evidence / one.needed):
        if one.effect.id not in fitted or one.evidence > SURE_RATIO * one.needed:
            continue
        if held_out.carried(search, one.effect) < MIN_CARRIED_SHARE * one.evidence:
            return one.effect.id
    return ""
