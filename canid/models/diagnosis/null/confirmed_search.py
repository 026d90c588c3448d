"""The search, repeated until every name predicts and is beyond what the driver's own noise gives in the loop.

A name needs a gain in one-step predictive log score on held-out data that is surely above 0, and an evidence that drives
of the same driver without it, behind the same lead, do not reach. The gain of the simulation is compared with theirs: the
loop carries the driver's own noise back into the inputs, and an open-loop simulation gains from whatever is free of it.

Of car following every search is cross-validated as well. The distribution of the evidence on the data that chose a cause
assumes a known noise model. Held-out data need no such assumption: a change point, a speed or a width chosen by chance
explains nothing elsewhere. A cause that makes the simulation of held-out data worse, and does not predict its next sample
better either, is not the cause. The simulation alone drops none: in closed loop the driver's own noise is in the inputs, and
the true law may simulate worse than a wrong one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Generic, NamedTuple, Protocol

from canid.models.diagnosis.driver import driver_search, held_out
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import DriverModel
from canid.models.diagnosis.driver.driver_search import CauseSearch, Search
from canid.models.diagnosis.driver.held_out import Fold
from canid.models.diagnosis.fitting.fitted_model import D, M
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.null import predictive_score, sequential
from canid.models.diagnosis.null.sequential import Gone, Statistics
from canid.models.effects.effect import Effect, Kind
from canid.values.findings import NullGain
from canid.values.text.names import readable
from canid.values.types import Interval

# times the needed evidence; above it no false cause was ever seen
SURE_RATIO = 2.5
# of its evidence that a cause must win on data that did not fit it; a true one wins nearly all of it
MIN_CARRIED_SHARE = 0.25


def cross_validated(
    data: DriverData, effects: tuple[Effect, ...], fitted: FittedDriver
) -> Checked[DriverData, DriverModel]:
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
            folds = held_out.folds(data, search, driver_search.again)
            gain = held_out.simulation_gain(data, search, folds) if search.named else Interval()
            if not worse(gain, data, search, folds):
                return Checked(search, folds, gain, tuple(refused))
            chance, why = (
                _weakest(search),
                "simulation and one-step predictions of held-out data gain nothing",
            )
        refused.append(f"{readable(chance)} dropped: {why}")
        effects = tuple(effect for effect in effects if effect.id != chance)


def worse(gain: Interval, data: DriverData, search: Search, folds: Sequence[Fold[DriverModel]]) -> bool:
    """Do the causes make the simulation of held-out data worse, and its one-step predictions not surely better?

    Args:
        gain: of the simulation's error variance on held-out data.
        data: the drive.
        search: what was found on it.
        folds: both models, fold by fold.
    """
    # a pedal that stands still at times is simulated by the same mean law: the next sample shows whether it helps
    if not gain.value < 0 or not (search.solved.model.effects or search.random_walk):
        return False
    return not predictive_score.of_whole(data, search, folds, search.baseline.noise.size).low > 0


def _weakest(search: Search) -> str:
    return min(search.named, key=lambda cause: cause.evidence / cause.needed).effect.id


def _chance(search: Search) -> str:
    """Id of the weakest cause that does not carry over; "" where all do."""
    fitted = {effect.id for effect in search.solved.model.effects if effect.kind is Kind.PARAMETRIC}
    for cause in sorted(search.named, key=lambda cause: cause.evidence / cause.needed):
        if cause.effect.id not in fitted or cause.evidence > SURE_RATIO * cause.needed:
            continue
        if held_out.carried(search, cause.effect) < MIN_CARRIED_SHARE * cause.evidence:
            return cause.effect.id
    return ""


class Confirmed(NamedTuple, Generic[D, M]):
    """A search whose names stand, and what they gain."""

    search: CauseSearch[D, M]
    refused: tuple[str, ...]  # sentences
    folds: tuple[Fold[M], ...]
    gain: Interval  # of the simulation's error variance, of all names together
    null_gain: NullGain
    log_score: Interval  # nats/min, of all names together
    log_scores: Mapping[str, Interval]  # effect id -> over the model without it


class Checked(NamedTuple, Generic[D, M]):
    """A search on one drive, its models fitted to all but each fold, and what it was made without."""

    search: CauseSearch[D, M]
    folds: tuple[Fold[M], ...]
    gain: Interval  # of the simulation's error variance on held-out data
    refused: tuple[str, ...] = ()  # sentences


class Block(Protocol[D, M]):
    """What the search asks of a task."""

    def search(self, effects: tuple[Effect, ...]) -> Checked[D, M]:
        """Search among these effects."""
        ...

    def scores(
        self, search: CauseSearch[D, M], folds: Sequence[Fold[M]]
    ) -> tuple[Interval, Mapping[str, Interval]]:
        """Gain in one-step log score of all names together, and of each."""
        ...

    def replicates(self, search: CauseSearch[D, M], tested: Sequence[Named]) -> Iterator[Statistics]:
        """What drives of the same driver without the names give, one by one."""
        ...

    def testable(self, effect: Effect) -> bool:
        """Is its evidence one that the driver's own noise may give?"""
        ...

    @property
    def where(self) -> str:
        """The loop that is simulated, for a sentence."""
        ...


def search_causes(
    block: Block[D, M], effects: tuple[Effect, ...], progress: Callable[[float], None]
) -> Confirmed[D, M]:
    """Search until every name stands.

    Args:
        block: the task.
        effects: candidates of the driver's block.
        progress: is given the fraction that is done.
    """
    refused: list[str] = []
    while True:
        search, folds, gain, dropped = block.search(effects)
        refused += dropped
        if not search.named:
            return Confirmed(search, tuple(refused), folds, Interval(), NullGain(), Interval(), {})
        whole, each = block.scores(search, folds)
        gone, null_gain = sequential.unpredictive(search.named, each), NullGain()
        if gone is None:
            gone, null_gain = _within_null(block, search, progress)
        if gone is None:
            return Confirmed(search, tuple(refused), folds, gain, null_gain, whole, each)
        withdrawn, why = gone
        refused.append(f"{readable(withdrawn.effect.id)} withdrawn: {why}")
        # a rival is another law of the same data: it is named and judged by itself
        effects = tuple(effect for effect in effects if effect.id != withdrawn.effect.id)


def _within_null(
    block: Block[D, M], search: CauseSearch[D, M], progress: Callable[[float], None]
) -> tuple[Gone | None, NullGain]:
    """The name whose evidence the null reaches, if any; and the null's gain of the simulation."""
    tested = [cause for cause in search.named if block.testable(cause.effect)]
    if not tested:
        return None, NullGain()
    made = block.replicates(search, tested)
    return sequential.within_null(tested, made, block.where, progress)
