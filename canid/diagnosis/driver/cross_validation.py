"""Search with cross-validation: a weak cause must gain on held-out data, or the search is repeated without it.

The distribution of the evidence on the data that chose a cause assumes a known noise model. Held-out data need no such
assumption: a change point, a speed or a width chosen by chance explains nothing elsewhere.
"""

from __future__ import annotations

from typing import NamedTuple

from canid.diagnosis.driver import driver_search, held_out
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_search import Search
from canid.effects.effect import Effect, Kind

# times the needed evidence; above it no false cause was ever seen
SURE_RATIO = 2.5
# of its evidence that a cause must win on data that did not fit it; a true one wins nearly all of it
MIN_CARRIED_SHARE = 0.25


class Confirmed(NamedTuple):
    """A search, and the effects that it was made without."""

    search: Search
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
        if not chance:
            return Confirmed(search, tuple(refused))
        refused.append(f"{chance} dropped: it explains nothing on held-out data")
        effects = tuple(effect for effect in effects if effect.id != chance)


def _chance(search: Search) -> str:
    """Id of the weakest cause that does not carry over; "" where all do."""
    fitted = {effect.id for effect in search.solved.model.effects if effect.kind is Kind.PARAMETRIC}
    for one in sorted(search.named, key=lambda one: one.evidence / one.needed):
        if one.effect.id not in fitted or one.evidence > SURE_RATIO * one.needed:
            continue
        if held_out.carried(search, one.effect) < MIN_CARRIED_SHARE * one.evidence:
            return one.effect.id
    return ""
