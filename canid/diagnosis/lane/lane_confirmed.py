"""The search of lane keeping, repeated until every name predicts held-out data and is beyond the driver's own noise.

As in car following: a name needs a gain in one-step predictive log score on held-out data that is surely above 0, and an
evidence that drives of the same driver without it, on the same road in closed loop, do not reach.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver import held_out, pedal_holds
from canid.diagnosis.fitting import log_score_gain
from canid.diagnosis.fitting.fitted_model import dropped
from canid.diagnosis.fitting.search import Named
from canid.diagnosis.lane import lane_held_out, lane_null, lane_search
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.diagnosis.lane.lane_search import Search
from canid.diagnosis.null import names, predictive_score, sequential
from canid.diagnosis.null.names import Gone, Statistics
from canid.effects.effect import Effect, Kind
from canid.findings import NullGain
from canid.types import Interval


class Confirmed(NamedTuple):
    """A search whose names stand, and what they gain."""

    search: Search
    refused: tuple[str, ...]  # sentences
    gain: Interval  # of the simulation's error variance on held-out data, of all names together
    null_gain: NullGain  # of the same names on drives without them
    log_scores: dict[str, Interval]  # effect id -> nats/min over the model without it
    log_score: Interval  # nats/min, of all names together


def search_causes(
    data: LaneData,
    effects: tuple[Effect, ...],
    fitted: FittedLane,
    seed: int,
    progress: Callable[[float], None],
) -> Confirmed:
    """Search until every name stands.

    Args:
        data: the recorded drive.
        effects: candidates.
        fitted: the baseline.
        seed: of the draws.
        progress: is given the fraction of the replicates that is done.
    """
    refused: list[str] = []
    while True:
        search = lane_search.search_causes(data, effects, fitted)
        if not search.named:
            return Confirmed(search, tuple(refused), Interval(), NullGain(), {}, Interval())
        scores = {one.effect.id: _predicted(data, search, one) for one in search.named}
        gone = names.unpredictive(search.named, scores)
        null_gain = NullGain()
        if gone is None:
            gone, null_gain = _within_null(data, search, seed, progress)
        if gone is None:
            whole = _predicted_by_all(search) if len(search.named) > 1 else next(iter(scores.values()))
            episodes = search.holds.episodes if search.holds is not None else ()
            gain = lane_held_out.gain(data, search.baseline, search.data, search.solved, episodes)
            return Confirmed(search, tuple(refused), gain, null_gain, scores, whole)
        one, why = gone
        refused.append(f"{one.effect.id} withdrawn: {why}")
        effects = tuple(effect for effect in effects if effect.id != one.effect.id)


def _predicted(data: LaneData, search: Search, one: Named) -> Interval:
    """Gain of one cause in log score on held-out data, nats/min."""
    if one.effect.kind is not Kind.PARAMETRIC:
        return _held(data)
    left = dropped(search.data, search.solved, one.effect.id)
    return _gain(search, left)


def _predicted_by_all(search: Search) -> Interval:
    """Gain of all fitted causes; that of standstills is apart."""
    ids = [effect.id for effect in search.solved.model.effects]
    return _gain(search, dropped(search.data, search.solved, *ids)) if ids else Interval()


def _gain(search: Search, left: FittedLane) -> Interval:
    rows, size = search.solved.rows & left.rows, left.noise.size
    base, extended = (predictive_score.by_fold(search.data, fit, rows, size) for fit in (left, search.solved))
    return log_score_gain.gain(predictive_score.difference(base, extended, rows), rows, search.data.output.dt)


def _held(data: LaneData) -> Interval:
    """What a wheel that has stood for some time predicts of the next sample, as `predictive_score` has it of pedals."""
    output = data.output
    step = pedal_holds.step_size(output.y[output.usable])
    still = np.abs(np.diff(output.y, prepend=np.nan)) < 0.5 * step
    stood = predictive_score.run_length(still)
    plain = (stood > 0).astype(np.int64)
    fine = np.digitize(stood, predictive_score.RESTS)
    counted = output.usable & np.r_[False, output.usable[:-1]]
    out = predictive_score.of_standstills(still, plain, fine, counted, held_out.dealt(data))
    return log_score_gain.gain(out, counted, output.dt)


def _within_null(
    data: LaneData, search: Search, seed: int, progress: Callable[[float], None]
) -> tuple[Gone | None, NullGain]:
    """The name whose evidence drives without it reach, if any; and the gain of the simulation on such drives."""
    tested = [one for one in search.named if one.effect.kind is Kind.PARAMETRIC]
    on = lane_null.road(data)
    if not tested or on is None:
        return None, NullGain()

    def made() -> Iterator[Statistics]:
        for batch in range(sequential.BATCHES):
            for drive in lane_null.simulated(data, search.baseline, on, sequential.BATCH, [seed, batch]):
                found = lane_null.statistics(drive, search.baseline, [one.effect for one in tested])
                if found is not None:
                    yield found

    return names.within_null(tested, made(), lambda _: True, "on this road", progress)
