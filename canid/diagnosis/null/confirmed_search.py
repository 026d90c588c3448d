"""The search, repeated until every name predicts and is beyond what the driver's own noise gives in the loop.

A name needs a gain in one-step predictive log score on held-out data that is surely above 0, and an evidence that drives
of the same driver without it, behind the same lead, do not reach. The gain of the simulation is compared with theirs: the
loop carries the driver's own noise back into the inputs, and an open-loop simulation gains from whatever is free of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from canid.diagnosis.driver import cross_validation
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.driver.held_out import Fold
from canid.diagnosis.null import bootstrap, names, predictive_score, replicates, sequential
from canid.diagnosis.null.names import Gone, Statistics
from canid.diagnosis.null.noise_source import Source
from canid.diagnosis.null.replicates import Drive
from canid.diagnosis.null.sequential import Answer
from canid.effects.effect import Effect
from canid.findings import NullGain
from canid.types import Interval

# that a gain which decides no name is compared with; its 95 % point is that of Student's prediction interval
GAIN_REPLICATES = 9


class Confirmed(NamedTuple):
    """A search whose names stand, and what they gain."""

    search: Search
    refused: tuple[str, ...]  # sentences
    folds: tuple[Fold, ...]
    gain: Interval  # of the simulation's error variance, of all names together
    null_gain: NullGain
    log_score: Interval  # nats/min, of all names together
    log_scores: dict[str, Interval]  # effect id -> over the model without it


def search_causes(
    drive: Drive,
    effects: tuple[Effect, ...],
    fitted: FittedDriver,
    noise: Callable[[], Source],
    seed: int,
    progress: Callable[[float], None],
) -> Confirmed:
    """Search until every name stands.

    Args:
        drive: the recorded one.
        effects: candidates of the driver's block.
        fitted: the baseline.
        noise: of the baseline's driver, made when it is needed.
        seed: of the draws.
        progress: is given the fraction that is done.
    """
    refused: list[str] = []
    data = drive.data
    source: Source | None = None
    while True:
        checked = cross_validation.search_causes(data, effects, fitted)
        search, folds, gain = checked.search, checked.folds, checked.gain
        refused += checked.refused
        if not search.named:
            return Confirmed(search, tuple(refused), folds, Interval(), NullGain(), Interval(), {})
        source = source or noise()
        whole = predictive_score.of_whole(data, search, source.scale)
        each = predictive_score.of_each(data, search, source.scale, whole)
        gone = names.unpredictive(search.named, each)
        if gone is None:
            gone, of_null = _within_null(drive, search, gain, source, seed, progress)
        if gone is None:
            return Confirmed(search, tuple(refused), folds, gain, of_null, whole, each)
        one, why = gone
        refused.append(f"{one.effect.id} withdrawn: {why}")
        # a rival is another law of the same data: it is named and judged by itself
        effects = tuple(effect for effect in effects if effect.id != one.effect.id)


def _within_null(
    drive: Drive,
    search: Search,
    gain: Interval,
    source: Source,
    seed: int,
    progress: Callable[[float], None],
) -> tuple[Gone | None, NullGain]:
    """The name whose evidence the null reaches, if any; and the null's gain of the simulation."""
    tested = [one for one in search.named if bootstrap.testable(one.effect)]
    if not tested:
        return None, NullGain()

    def made() -> Iterator[Statistics]:
        for batch in range(sequential.BATCHES):
            for one in replicates.simulated(
                drive, search.baseline, source, sequential.BATCH, [seed, 0, batch]
            ):
                found = bootstrap.statistics(one, search.baseline, tested)
                if found is not None:
                    yield found

    def settled(gains: list[float]) -> bool:
        return sequential.answer(gain.value, gains) is not Answer.OPEN or len(gains) >= GAIN_REPLICATES

    return names.within_null(tested, made(), settled, "behind this lead", progress)
