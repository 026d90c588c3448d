"""A search whose weak finds must win on data that did not fit them; what wins nothing there is chance, and searched without.

Evidence on the data that chose a cause has a law, and the law rests on a noise that is known. Time held out needs neither:
a moment at which a gain changes, a speed, a width that chance chose explain nothing elsewhere.
"""

from __future__ import annotations

from typing import NamedTuple

from canid.diagnosis import held_out, naming
from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.naming import Search
from canid.diagnosis.solved import Solved
from canid.effects.cause import Effect

# times the evidence that a cause needs: above, no chance was ever seen
SURE = 2.5
# of its evidence that a cause must win on data that did not fit it; a true one wins nearly all of it
CARRIED = 0.25


class Confirmed(NamedTuple):
    """A search, and what it was made without."""

    search: Search
    refused: tuple[str, ...]  # sentences


def search_causes(data: DriverData, effects: tuple[Effect, ...], fitted: Solved) -> Confirmed:
    """Search until every cause that is named carries over.

    Args:
        data: the driver's columns.
        effects: candidates of the driver's block.
        fitted: the baseline.
    """
    refused: list[str] = []
    while True:
        search = naming.search_causes(data, effects, fitted)
        assert search is not None
        chance = _chance(search)
        if not chance:
            return Confirmed(search, tuple(refused))
        refused.append(f"{chance} left again: on data that did not fit it, it explains nothing")
        effects = tuple(effect for effect in effects if effect.id != chance)


def _chance(search: Search) -> str:
    """Id of the weakest cause that does not carry over; "" where all do."""
    fitted = {effect.id for effect in search.solved.model.effects if effect.kind == "curve"}
    for one in sorted(search.named, key=lambda one: one.evidence / one.needed):
        if one.effect.id not in fitted or one.evidence > SURE * one.needed:
            continue
        if held_out.carried(search, one.effect) < CARRIED * one.evidence:
            return one.effect.id
    return ""
