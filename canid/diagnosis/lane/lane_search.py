"""Search for the causes of a driver who keeps the lane: forward selection, each refitted with those before it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver import pedal_holds
from canid.diagnosis.driver.driver_search import (
    EPISODE_EDGE_S,
    FORM_EVIDENCE_SHARE,
    MIN_ROWS,
    RIVAL_SHARE,
    START_CHANCES,
)
from canid.diagnosis.fitting import likelihood
from canid.diagnosis.fitting.candidates import needed_still, still_named, with_rivals
from canid.diagnosis.fitting.fitted_model import dropped, scaled_by_state, solve
from canid.diagnosis.fitting.model import place
from canid.diagnosis.fitting.robust_covariance import needed
from canid.diagnosis.fitting.search import Named, Option, Step, forward_selection
from canid.diagnosis.lane import lane_candidates
from canid.diagnosis.lane.lane_candidates import LaneCandidate
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.effects.effect import Detector, Effect, Kind

# of a parameter's range; nearer than this it stands at its bound and stands for another cause
BOUND_RANGE_SHARE = 1e-3


class Holds(NamedTuple):
    """Stretches in which the wheel stands still although the model would turn it."""

    episodes: tuple[tuple[int, int], ...]  # [start, stop) samples
    evidence: float  # 2 Δ log likelihood


Found = LaneCandidate | Holds


class Search(NamedTuple):
    """What the search ended with."""

    baseline: FittedLane  # on all the data
    data: LaneData  # without the episodes
    solved: FittedLane  # with all effects
    named: tuple[Named, ...] = ()
    steps: tuple[Step, ...] = ()
    holds: Holds | None = None


def search_causes(data: LaneData, effects: tuple[Effect, ...], fitted: FittedLane) -> Search:
    """Search, one cause after another.

    Args:
        data: the columns.
        effects: candidates.
        fitted: the baseline.
    """
    curves = lane_candidates.searchable(effects, data)
    holding = [effect for effect in effects if Detector.PEDAL_HOLDS in effect.detectors]

    def propose(state: Search, step: int) -> tuple[Search, list[Option[Found]]]:
        if state.holds is None and holding:
            seen = detect(state.data, state.solved)
            if seen is not None:
                one = Step(holding[0], step, seen.evidence, pedal_holds.NEEDED_EVIDENCE)
                return state, [Option(one, seen, certain=True)]
        form = FORM_EVIDENCE_SHARE * sum(one.evidence for one in state.named)
        options = list[Option[Found]]()
        for found in lane_candidates.candidates(curves, state.data, state.solved):
            searched = found.effect.shows_desired_headway
            bound = needed(found.parameters, len(effects) * (START_CHANCES if searched else 1)) + form
            if not _at_bound(found):
                options.append(Option(Step(found.effect, step, found.evidence, bound), found))
        return state, options

    found, steps = forward_selection(Search(fitted, data, fitted), propose, _accept)
    kept = needed_still(found.data, found.solved, len(effects), least=1)
    named = still_named(found.named, kept)
    found = found._replace(solved=kept.solved, steps=steps)
    return found._replace(named=tuple(_with_rivals(one, found, curves) for one in named))


def detect(data: LaneData, solved: FittedLane) -> Holds | None:
    """Find stretches in which the wheel is held; None: too few, or they may be chance."""
    step = pedal_holds.step_size(data.output.y[data.output.usable])
    spans, evidence = pedal_holds.episodes(pedal_holds.holding(data.output, solved, step), data.output.dt)
    if len(spans) < pedal_holds.MIN_EPISODES or evidence < pedal_holds.NEEDED_EVIDENCE:
        return None
    return Holds(spans, float(evidence))


def _accept(state: Search, option: Option[Found]) -> tuple[Search, bool]:
    """Take an effect into the model; the search goes on."""
    step, found = option.step, option.found
    if isinstance(found, Holds):
        data, solved = without_holds(state.data, state.solved, found)
        t, dt = data.t, data.output.dt
        spans = tuple((float(t[a]), float(t[b - 1]) + dt) for a, b in found.episodes)
        named = Named(step.effect, step.evidence, step.needed, (), spans)
        return state._replace(data=data, solved=solved, holds=found, named=(*state.named, named)), True
    data, solved = state.data, found.solved
    # the noise scale again, now that a cause is out of it
    noise = scaled_by_state(data, solved.model, solved.fitted, solved.noise, solved.rows)
    solved = solve(data, solved.model, solved.q, noise, solved.rows)
    named = Named(step.effect, step.evidence, step.needed)
    return state._replace(solved=solved, named=(*state.named, named)), True


def without_holds(data: LaneData, solved: FittedLane, found: Holds) -> tuple[LaneData, FittedLane]:
    """Mask the episodes, and fit again."""
    at = np.zeros(data.t.size, dtype=bool)
    edge = round(EPISODE_EDGE_S / data.output.dt)
    for start, stop in found.episodes:
        at[max(start - 1, 0) : stop + edge] = True
    masked = data._replace(output=data.output._replace(usable=data.output.usable & ~at))
    rows = likelihood.counted(masked.output, solved.noise.A.size - 1)
    if int(rows.sum()) < MIN_ROWS:
        return data, solved
    return masked, solve(masked, solved.model, solved.q, solved.noise, rows)


def _at_bound(found: LaneCandidate) -> bool:
    where = place(found.solved.model, found.effect.id)
    for p, k in zip(found.effect.parameters, range(where.start, where.stop), strict=True):
        near = BOUND_RANGE_SHARE * (p.high - p.low)
        if any(abs(float(found.solved.q[k]) - limit) < near for limit in (p.low, p.high) if limit != 0.0):
            return True
    return False


def _with_rivals(one: Named, found: Search, curves: tuple[Effect, ...]) -> Named:
    """Name the causes that explain the same as well as this one."""
    data, solved, fixed = found.data, found.solved, one.effect.rivals
    have = {effect.id for effect in solved.model.effects}
    if one.effect.kind is not Kind.PARAMETRIC:
        return one._replace(rivals=fixed)
    worth = {step.effect.id for step in found.steps if step.evidence > RIVAL_SHARE * one.evidence} - have
    if not worth:
        return one._replace(rivals=fixed)
    left = dropped(data, solved, one.effect.id)
    swaps = lane_candidates.candidates(tuple(e for e in curves if e.id in worth), data, left)
    return with_rivals(one, swaps, solved, found.steps)
