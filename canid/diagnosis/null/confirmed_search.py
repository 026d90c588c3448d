"""The search, repeated until every name predicts and is beyond what the driver's own noise gives in the loop.

A name needs a gain in one-step predictive log score on held-out data that is surely above 0, and an evidence that drives
of the same driver without it, behind the same lead, do not reach. The gain of the simulation is compared with theirs: the
loop carries the driver's own noise back into the inputs, and an open-loop simulation gains from whatever is free of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver import cross_validation
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_search import Search
from canid.diagnosis.driver.held_out import Fold
from canid.diagnosis.fitting.search import Named
from canid.diagnosis.null import bootstrap, predictive_score, replicates, sequential
from canid.diagnosis.null.noise_source import Source
from canid.diagnosis.null.replicates import Drive
from canid.diagnosis.null.sequential import Answer
from canid.effects.effect import Effect
from canid.findings import NullGain
from canid.types import Interval

# replicates that are simulated side by side
BATCH = 5
# that a gain which decides no name is compared with: none of 19 at or above it is p = 0.05
GAIN_REPLICATES = 19


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
        gone = _unpredictive(search, each)
        if gone is None:
            gone, null_gain = _within_null(drive, search, gain, source, seed, progress)
        if gone is None:
            return Confirmed(search, tuple(refused), folds, gain, null_gain, whole, each)
        one, why = gone
        refused.append(f"{one.effect.id} withdrawn: {why}")
        # a rival is another law of the same data: it is named and judged by itself
        effects = tuple(effect for effect in effects if effect.id != one.effect.id)


def _unpredictive(search: Search, each: dict[str, Interval]) -> tuple[Named, str] | None:
    """The name that predicts least, where that is not surely more than nothing."""
    one = min(search.named, key=lambda one: each[one.effect.id].low)
    score = each[one.effect.id]
    if score.low > 0 or not np.isfinite(score.low):
        return None
    return (
        one,
        f"one-step predictions of held-out data gain {score.value:.2g} [{score.low:.2g}, {score.high:.2g}] nats/min",
    )


def _within_null(
    drive: Drive,
    search: Search,
    gain: Interval,
    source: Source,
    seed: int,
    progress: Callable[[float], None],
) -> tuple[tuple[Named, str] | None, NullGain]:
    """The name whose evidence the null reaches, if any; and the null's gain of the simulation."""
    tested = [one for one in search.named if bootstrap.testable(one.effect)]
    if not tested:
        return None, NullGain()
    evidence: dict[str, list[float]] = {one.effect.id: [] for one in tested}
    gains: list[float] = []
    for batch in range(-(-sequential.MOST // BATCH)):
        for one in replicates.simulated(drive, search.baseline, source, BATCH, [seed, 0, batch]):
            found = bootstrap.statistics(one, search.baseline, tested)
            if found is None:
                continue
            for effect, value in found.evidence.items():
                evidence[effect].append(value)
            gains.append(found.gain)
            progress(len(gains) / sequential.MOST)
            answers = [sequential.answer(name.evidence, evidence[name.effect.id]) for name in tested]
            for name, answer in zip(tested, answers, strict=True):
                if answer is Answer.NULL:
                    above = sum(value >= name.evidence for value in evidence[name.effect.id])
                    return (
                        name,
                        f"the driver's own noise, in closed loop behind this lead, gives its evidence too "
                        f"({above} of {len(gains)} replicates without it)",
                    ), NullGain()
            settled = sequential.answer(gain.value, gains) is not Answer.OPEN or len(gains) >= GAIN_REPLICATES
            if Answer.OPEN not in answers and settled:
                return None, _null_gain(gains)
    return None, _null_gain(gains)


def _null_gain(gains: list[float]) -> NullGain:
    if len(gains) < sequential.LEAST:
        return NullGain()
    return NullGain(float(np.median(gains)), sequential.point(gains), len(gains))
