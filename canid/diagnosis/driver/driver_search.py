"""Search for the driver's effects: forward selection, each refitted jointly with those before it and needed at the end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver import (
    driver_candidates,
    intermittent_control,
    pedal_holds,
    random_walk,
    spectral_line,
)
from canid.diagnosis.driver.driver_candidates import DriverCandidate
from canid.diagnosis.driver.driver_data import DriverData
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.driver.driver_model import K1
from canid.diagnosis.driver.random_walk import RandomWalk
from canid.diagnosis.fitting import likelihood
from canid.diagnosis.fitting.candidates import needed_still, still_named, with_rivals
from canid.diagnosis.fitting.fitted_model import dropped, scaled_by_state, solve
from canid.diagnosis.fitting.model import place
from canid.diagnosis.fitting.robust_covariance import needed
from canid.diagnosis.fitting.search import Named, Option, Step, forward_selection
from canid.effects.effect import Detector, Effect, Kind
from canid.types import Interval

# additional evidence that a cause next to a ceiling needs, in parts of what it needs alone: how far a soft limit bends
# the pedal below `SOFT_LIMIT_PERCENT` is not known
CEILING_SURCHARGE = 0.5
# % below a ceiling from which on it may bend the pedal
SOFT_LIMIT_PERCENT = 1.5
# 2 Δ log likelihood by which a fit from elsewhere must be better to show that the first was not the best
MIN_DEVIANCE_GAIN = 1.0
# of the evidence of causes already named, that a further one needs on top: the true form of a cause is never exactly
# the one that is fitted, and the remainder resembles another cause
FORM_EVIDENCE_SHARE = 0.01
# desired headways, speeds, levels, times along a drive that are chances of their own
START_CHANCES = 3
# of a cause's evidence that a rival must have had at some step to be fitted again
RIVAL_SHARE = 0.3
# s after an episode in which the pedal returns to the demand
EPISODE_EDGE_S = 0.5
# samples that must count with episodes taken out; with fewer the model is left as it was fitted with them
MIN_ROWS = 300
# of an interval between decisions, by which the last decision of a drive may be off and still be in step
IN_STEP_SHARE = 0.25
# of a parameter's range; nearer than this it stands at its bound
BOUND_RANGE_SHARE = 1e-3

# detectors of one effect in what a model leaves
RESIDUAL_DETECTORS = {
    Detector.SPECTRAL_LINE: spectral_line.detect,
    Detector.INTERMITTENT_CONTROL: intermittent_control.detect,
}
# what an option may be: a fitted effect, a random walk, or episodes in the pedal itself
Found = DriverCandidate | RandomWalk | pedal_holds.Holds


class Search(NamedTuple):
    """What the search ended with."""

    baseline: FittedDriver  # on all the data
    data: DriverData  # with what was taken out of it: episodes masked, a random walk subtracted, a ceiling marked
    solved: FittedDriver  # with all effects
    named: tuple[Named, ...] = ()
    steps: tuple[Step, ...] = ()
    random_walk: RandomWalk | None = None
    holds: tuple[pedal_holds.Holds, ...] = ()
    among: tuple[Effect, ...] = ()  # all that were candidates
    candidates: tuple[DriverCandidate, ...] = ()  # of the last step, fitted in full

    def has(self, effect: str) -> bool:
        """Is it named already?"""
        return any(one.effect.id == effect for one in self.named)


def search_causes(data: DriverData, effects: tuple[Effect, ...], fitted: FittedDriver) -> Search:
    """Search, one cause after another.

    Args:
        data: the driver's columns.
        effects: candidates of the driver's block.
        fitted: the baseline.
    """
    curves = tuple(effect for effect in effects if effect.kind is Kind.PARAMETRIC and effect.identifiable)
    measured = data

    def propose(state: Search, step: int) -> tuple[Search, list[Option[Found]]]:
        return _propose(state, step, effects, curves, measured)

    def accept(state: Search, option: Option[Found]) -> tuple[Search, bool]:
        return _accept(state, option, measured)

    found, steps = forward_selection(Search(fitted, data, fitted, among=effects), propose, accept)
    kept = needed_still(found.data, found.solved, len(effects), least=1)
    named = still_named(found.named, kept)
    found = found._replace(solved=kept.solved, steps=steps)
    return found._replace(named=tuple(_with_rivals(one, found, kept.without, curves) for one in named))


def _propose(
    state: Search, step: int, effects: tuple[Effect, ...], curves: tuple[Effect, ...], measured: DriverData
) -> tuple[Search, list[Option[Found]]]:
    """Everything that may be added to the model."""
    m = len(effects)
    # standstills are in the pedal as measured, not in what a random walk has left of it
    whole = state.data._replace(output=state.data.output._replace(y=measured.output.y))
    seen = pedal_holds.detect(whole, state.solved, state.holds)
    for effect in effects:
        if seen.pattern in effect.detectors and not state.has(effect.id):
            return state, [_option(effect, step, seen.evidence, seen.needed, seen, certain=True)]
    form = FORM_EVIDENCE_SHARE * sum(one.evidence for one in state.named)
    solved, tried = _tried(curves, state.data, state.solved)
    # another minimum of the baseline itself is the baseline: both models begin with the same one
    baseline = state.baseline if state.named else solved
    state = state._replace(solved=solved, baseline=baseline, candidates=tuple(tried))
    data, options = state.data, list[Option[Found]]()
    capped = bool(np.isfinite(pedal_holds.ceiling(state.holds)))
    for candidate in tried:
        # a ceiling that was seen in the pedal itself needs no second one
        if capped and Detector.PEDAL_CEILING in candidate.effect.detectors:
            continue
        # without the effect its desired headway, speed, level or time is not identifiable: the best of these is the
        # best of several chances (Davies 1977)
        effect = candidate.effect
        searched = effect.shows_desired_headway or any(callable(p.initial) for p in effect.parameters)
        bound = needed(candidate.parameters, m * (START_CHANCES if searched else 1)) + form
        options.append(_option(effect, step, candidate.evidence, bound, candidate))
    for effect in effects:
        for detector in effect.detectors:
            if detector in RESIDUAL_DETECTORS and not state.has(effect.id):
                found, bound = RESIDUAL_DETECTORS[detector](effect, data, solved, m)
                if found is not None:
                    options.append(_option(effect, step, found.evidence, bound, found))
        if Detector.RANDOM_WALK in effect.detectors and state.random_walk is None:
            drift = random_walk.detect(data, solved)
            if drift is not None:
                options.append(_option(effect, step, drift.evidence, needed(1, m), drift))
    if capped:
        options = [
            one._replace(step=one.step._replace(needed=(1 + CEILING_SURCHARGE) * one.step.needed))
            for one in options
        ]
    return state, [option for option in options if not _at_bound(option.found)]


def _option(
    effect: Effect, step: int, evidence: float, bound: float, found: Found, *, certain: bool = False
) -> Option[Found]:
    return Option(Step(effect, step, evidence, bound), found, certain)


def _accept(state: Search, option: Option[Found], measured: DriverData) -> tuple[Search, bool]:
    """Take an effect into the model, and whether the search goes on."""
    step, found = option.step, option.found
    if isinstance(found, pedal_holds.Holds):
        # what is decided between two movements of the pedal is not seen: nothing finer can be found after that
        return _with_holds(state, step, found), not step.effect.intermittent
    if isinstance(found, RandomWalk):
        return _with_random_walk(state, step, found), True
    if Detector.PEDAL_CEILING in step.effect.detectors and state.data.pedal:
        # at the ceiling the noise goes one way only: samples there are explained by the limit alone
        y = measured.output.y
        level = float(found.solved.q[found.solved.model.where[-1].start])
        at = state.data.output.usable & (y >= level - 0.5 * pedal_holds.step_size(y))
        spans = pedal_holds.standing(at, state.data.output.dt)
        ceiling = pedal_holds.Holds(Detector.PEDAL_CEILING, spans, step.evidence, level)
        return _with_holds(state, step, ceiling), True
    data, solved = state.data, found.solved
    # the noise scale again, now that a cause is out of it
    noise = scaled_by_state(data, solved.model, solved.fitted, solved.noise, solved.rows)
    solved = solve(data, solved.model, solved.q, noise, solved.rows)
    estimate = _rhythm(step.effect, solved, data)
    return _named(state, step, estimate=estimate)._replace(solved=solved), True


def _named(
    state: Search,
    step: Step,
    episodes: tuple[tuple[float, float], ...] = (),
    estimate: Interval | None = None,
    level: float = np.nan,
) -> Search:
    one = Named(step.effect, step.evidence, step.needed, (), episodes, estimate, level)
    return state._replace(named=(*state.named, one))


def _with_random_walk(state: Search, step: Step, found: RandomWalk) -> Search:
    """Subtract the random walk of the desired headway from the output."""
    solved, output = state.solved, state.data.output
    data = state.data._replace(output=output._replace(y=output.y - found.added))
    answered = float(solved.q[K1])
    solved = solve(data, solved.model, solved.q, found.noise, solved.rows)
    # without the walk the gain on headway is larger: the same pedal is a smaller change of the desired headway
    ratio = min(abs(answered / float(solved.q[K1])), 1.0) if solved.q[K1] else 1.0
    estimate = Interval(*(ratio * value for value in found.sd))
    return _named(state, step, estimate=estimate)._replace(data=data, solved=solved, random_walk=found)


def _with_holds(state: Search, step: Step, found: pedal_holds.Holds) -> Search:
    """Take what was seen in the pedal itself out of what is fitted."""
    data, solved = without_holds(state.data, state.solved, found)
    t, dt = data.seen.t, data.output.dt
    spans = tuple((float(t[a]), float(t[b - 1]) + dt) for a, b in found.episodes)
    state = state._replace(data=data, solved=solved, holds=(*state.holds, found))
    return _named(state, step, spans, _ceiling_level(found, data), found.level)


def _tried(
    curves: tuple[Effect, ...], data: DriverData, solved: FittedDriver
) -> tuple[FittedDriver, list[DriverCandidate]]:
    """Try the parametric causes; where a fit shows that the model without it had ended in a local minimum, try again."""
    found = driver_candidates.candidates(curves, data, solved)
    if found:
        best = max(
            found,
            key=lambda candidate: (
                candidate.evidence - driver_candidates.EVIDENCE_PER_PARAMETER * candidate.parameters
            ),
        )
        k = solved.q.size
        again = solve(data, solved.model, best.solved.q[:k], best.solved.noise, solved.rows)
        better = again.deviance < solved.deviance - MIN_DEVIANCE_GAIN
        if better and not driver_candidates.simulates_worse(data, again, solved):
            return again, driver_candidates.candidates(curves, data, again)
    return solved, found


def _at_bound(what: Found) -> bool:
    """Is a fitted strength at its physical bound? Then it stands for another cause."""
    if isinstance(what, RandomWalk | pedal_holds.Holds):
        return False
    solved = what.solved
    where = place(solved.model, what.effect.id)
    for p, k in zip(what.effect.parameters, range(where.start, where.stop), strict=True):
        near = BOUND_RANGE_SHARE * (p.high - p.low)
        limits = [limit for limit in (p.low, p.high) if limit != 0.0 and p.unit != "rad"]
        if k in solved.fitted.free and any(abs(float(solved.q[k]) - limit) < near for limit in limits):
            return True
    return False


def _rhythm(effect: Effect, solved: FittedDriver, data: DriverData) -> Interval | None:
    """Interval of the rhythm: outside of it the decisions are out of step at one end of the drive."""
    if Detector.INTERMITTENT_CONTROL not in effect.detectors:
        return None
    interval = float(solved.q[solved.model.where[-1].start])
    off = IN_STEP_SHARE * interval**2 / max(data.seen.duration, 1.0)
    return Interval(interval, interval - off, interval + off)


def _ceiling_level(found: pedal_holds.Holds, data: DriverData) -> Interval | None:
    if found.pattern is Detector.PEDAL_CEILING:
        half = pedal_holds.step_size(data.output.y[data.output.usable])
        # a soft limit lies a little above the highest level reached
        return Interval(found.level, found.level - half, found.level + max(half, 0.5 * SOFT_LIMIT_PERCENT))
    return None


def without_holds(
    data: DriverData, solved: FittedDriver, found: pedal_holds.Holds
) -> tuple[DriverData, FittedDriver]:
    """Take the episodes out of what is fitted: masked, or at a ceiling, where the demand is only known to be above."""
    n = data.seen.t.size
    at = np.zeros(n, dtype=bool)
    edge = round(EPISODE_EDGE_S / data.output.dt) if found.pattern is not Detector.PEDAL_CEILING else 0
    for start, stop in found.episodes:
        at[max(start - 1, 0) : min(stop + edge, n)] = True
    output = data.output
    if found.pattern is Detector.PEDAL_CEILING:
        # a soft limit bends the pedal before it stops it: above this level only the limit counts
        from_here = found.level - max(0.5 * pedal_holds.step_size(output.y), SOFT_LIMIT_PERCENT)
        above = output.usable & ~output.below & (output.y >= from_here)
        output = output._replace(above=above, ceiling=from_here)
    elif found.pattern is Detector.PEDAL_HOLDS:
        output = output._replace(usable=output.usable & ~at, below=output.below & ~at)
    data = data._replace(output=output)
    rows = likelihood.counted(output, solved.noise.A.size - 1)
    if int(rows.sum()) < MIN_ROWS:
        return data, solved
    return data, solve(data, solved.model, solved.q, solved.noise, rows)


def _with_rivals(
    one: Named, found: Search, without: dict[str, FittedDriver], curves: tuple[Effect, ...]
) -> Named:
    """Name the causes that explain the same as well as this one."""
    data, solved, fixed = found.data, found.solved, one.effect.rivals
    have = {effect.id for effect in solved.model.effects}
    if one.effect.id not in have or one.effect.kind is not Kind.PARAMETRIC:
        return one._replace(rivals=fixed)
    left = without[one.effect.id] if one.effect.id in without else dropped(data, solved, one.effect.id)
    # only candidates that explained a part of it at an earlier step
    worth = {step.effect.id for step in found.steps if step.evidence > RIVAL_SHARE * one.evidence} - have
    swaps = driver_candidates.candidates(tuple(e for e in curves if e.id in worth), data, left)
    return with_rivals(one, swaps, solved, found.steps)
