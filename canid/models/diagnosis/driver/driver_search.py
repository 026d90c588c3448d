"""Search for the driver's effects: forward selection, each refitted jointly with those before it and needed at the end."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Generic, NamedTuple

import numpy as np

from canid.mathematics.identification import movement_rhythm
from canid.models.diagnosis.driver import (
    driver_candidates,
    intermittent_control,
    local_minima,
    noise_law,
    pedal_holds,
    random_walk,
    spectral_line,
)
from canid.models.diagnosis.driver.driver_candidates import DriverCandidate
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import K1, DriverModel
from canid.models.diagnosis.driver.random_walk import RandomWalk
from canid.models.diagnosis.fitting import likelihood
from canid.models.diagnosis.fitting.candidates import (
    EVIDENCE_PER_PARAMETER,
    Candidate,
    at_bound,
    needed_still,
    simulates_worse,
    still_named,
    with_rivals,
)
from canid.models.diagnosis.fitting.fitted_model import D, FittedModel, M, solve
from canid.models.diagnosis.fitting.search import F, Named, Option, Step, forward_selection
from canid.models.diagnosis.fitting.uncertainty import needed
from canid.models.effects.effect import Detector, Effect, Kind
from canid.values.types import Interval

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
# s after an episode in which the pedal returns to the demand
EPISODE_EDGE_S = 0.5
# samples that must count with episodes taken out; with fewer the model is left as it was fitted with them
MIN_ROWS = 300
# of an interval between decisions, by which the last decision of a drive may be off and still be in step
IN_STEP_SHARE = 0.25
# detectors of one effect in what a model leaves
RESIDUAL_DETECTORS = {
    Detector.SPECTRAL_LINE: spectral_line.detect,
    Detector.INTERMITTENT_CONTROL: intermittent_control.detect,
}
# what an option may be: a fitted effect, a random walk, or episodes in the pedal itself
Found = DriverCandidate | RandomWalk | pedal_holds.Holds


class CauseSearch(NamedTuple, Generic[D, M]):
    """What the search ended with."""

    baseline: FittedModel[M]  # on all the data
    data: D  # with what was taken out of it: episodes masked, a random walk subtracted, a ceiling marked
    solved: FittedModel[M]  # with all effects
    named: tuple[Named, ...] = ()
    steps: tuple[Step, ...] = ()
    random_walk: RandomWalk | None = None
    holds: tuple[pedal_holds.Holds, ...] = ()
    among: tuple[Effect, ...] = ()  # all that were candidates
    candidates: tuple[Candidate[M], ...] = ()  # of the last step, fitted in full

    def has(self, effect: str) -> bool:
        """Is it named already?"""
        return any(cause.effect.id == effect for cause in self.named)


Search = CauseSearch[DriverData, DriverModel]


def search_causes(data: DriverData, effects: tuple[Effect, ...], fitted: FittedDriver) -> Search:
    """Search, one cause after another.

    Args:
        data: the driver's columns.
        effects: candidates of the driver's block.
        fitted: the baseline.
    """
    curves, measured = _curves(effects), data

    def propose(state: Search, step: int) -> tuple[Search, list[Option[Found]]]:
        return _propose(state, step, effects, curves, measured)

    def accept(state: Search, option: Option[Found]) -> tuple[Search, bool]:
        return _accept(state, option, measured)

    begin = Search(fitted, data, fitted, among=effects)
    return selected(begin, effects, curves, propose, accept, driver_candidates.candidates)


def selected(
    begin: CauseSearch[D, M],
    effects: tuple[Effect, ...],
    curves: tuple[Effect, ...],
    propose: Callable[[CauseSearch[D, M], int], tuple[CauseSearch[D, M], list[Option[F]]]],
    accept: Callable[[CauseSearch[D, M], Option[F]], tuple[CauseSearch[D, M], bool]],
    fitted: Callable[[tuple[Effect, ...], D, FittedModel[M]], Sequence[Candidate[M]]],
) -> CauseSearch[D, M]:
    """Accept causes as long as one explains more than chance; drop those that the others replace; name rivals.

    Args:
        begin: the baseline.
        effects: candidates.
        curves: those of them that are fitted.
        propose: as in `forward_selection`.
        accept: as in `forward_selection`.
        fitted: tries causes, each added to a model.
    """
    selected_causes, steps = forward_selection(begin, propose, accept)
    kept = needed_still(selected_causes.data, selected_causes.solved, len(effects))

    def swaps(worth: set[str], left: FittedModel[M]) -> Sequence[Candidate[M]]:
        return fitted(tuple(effect for effect in curves if effect.id in worth), selected_causes.data, left)

    still = still_named(selected_causes.named, kept)
    if not still:
        baseline = selected_causes.baseline
        return begin._replace(
            baseline=baseline, solved=baseline, steps=steps, candidates=selected_causes.candidates
        )
    named = tuple(with_rivals(cause, selected_causes.data, kept, steps, swaps) for cause in still)
    return selected_causes._replace(solved=kept.solved, steps=steps, named=named)


def again(effect: Effect, data: DriverData, without: FittedDriver) -> FittedDriver:
    """Search one effect's parameters on the rows of a model without it.

    Args:
        effect: one that is fitted.
        data: the driver's columns.
        without: the model.

    Returns:
        the model with it; the same where its pattern is not seen on these rows.
    """
    for detector in effect.detectors:
        if detector in RESIDUAL_DETECTORS:
            candidate, _ = RESIDUAL_DETECTORS[detector](effect, data, without, 1)
            return without if candidate is None else candidate.solved
    return driver_candidates.tried(
        effect, data, without, driver_candidates.screen(effect, data, without)
    ).solved


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
    form = FORM_EVIDENCE_SHARE * sum(cause.evidence for cause in state.named)
    solved, tried = _tried(curves, state.data, state.solved)
    # another minimum of the baseline itself is the baseline: both models begin with the same one
    baseline = state.baseline if state.named else solved
    state = state._replace(solved=solved, baseline=baseline, candidates=tuple(tried))
    data, options = state.data, list[Option[Found]]()
    capped = bool(np.isfinite(pedal_holds.ceiling(state.holds)))
    for candidate in tried:
        # a ceiling that was seen in the pedal itself, or a limit of the output, needs no second one
        if (capped or measured.output.above.any()) and Detector.PEDAL_CEILING in candidate.effect.detectors:
            continue
        options.append(
            _option(candidate.effect, step, candidate.evidence, _needed(candidate, m) + form, candidate)
        )
    for effect in effects:
        for detector in effect.detectors:
            if detector in RESIDUAL_DETECTORS and not state.has(effect.id):
                detected, bound = RESIDUAL_DETECTORS[detector](effect, data, solved, m)
                if detected is not None:
                    options.append(_option(effect, step, detected.evidence, bound, detected))
        if Detector.RANDOM_WALK in effect.detectors and state.random_walk is None:
            drift = random_walk.detect(data, solved)
            if drift is not None:
                options.append(_option(effect, step, drift.evidence, needed(1, m), drift))
    if capped:
        options = [
            option._replace(step=option.step._replace(needed=(1 + CEILING_SURCHARGE) * option.step.needed))
            for option in options
        ]
    return state, [
        option for option in options if not isinstance(option.found, Candidate) or not at_bound(option.found)
    ]


def first_step(
    data: DriverData, fitted: FittedDriver, effects: tuple[Effect, ...], least: float
) -> tuple[FittedDriver, list[DriverCandidate]]:
    """Every effect that is fitted, each added to the baseline alone; and the baseline, where a fit shows a better one.

    Args:
        data: the driver's columns.
        fitted: the baseline.
        effects: that are tried.
        least: evidence below which a candidate is of no use.
    """
    return _tried(_curves(effects), data, fitted, least)


def largest_margin(
    data: DriverData, fitted: FittedDriver, effects: tuple[Effect, ...], among: int, above: float
) -> float:
    """Largest evidence over what it needs, of all effects in the first step of a search; −inf: none reaches `above`.

    Args:
        data: the driver's columns.
        fitted: the baseline.
        effects: that are tried.
        among: effects that are counted.
        above: margin; below 0 where next to other names one has less left than it needed alone. What cannot reach it is
            not fitted.
    """
    solved, tried = first_step(data, fitted, effects, needed(1, among) + above)
    margins = [
        candidate.evidence - _needed(candidate, among) for candidate in tried if not at_bound(candidate)
    ]
    walks = any(Detector.RANDOM_WALK in effect.detectors for effect in effects)
    if walks and max(margins, default=-math.inf) < above:
        drift = random_walk.detect(data, solved)
        margins += [] if drift is None else [drift.evidence - needed(1, among)]
    return max(margins, default=-math.inf)


def _curves(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
    return tuple(effect for effect in effects if effect.kind is Kind.PARAMETRIC and effect.identifiable)


def _needed(candidate: DriverCandidate, among: int) -> float:
    """Evidence that a fitted effect needs.

    Without it its desired headway, speed, level or time is not identifiable: the best of these is the best of several
    chances (Davies 1977).
    """
    effect = candidate.effect
    searched = effect.shows_desired_headway or any(callable(p.initial) for p in effect.parameters)
    return needed(candidate.parameters, among * (START_CHANCES if searched else 1))


def _option(
    effect: Effect, step: int, evidence: float, bound: float, finding: Found, *, certain: bool = False
) -> Option[Found]:
    return Option(Step(effect, step, evidence, bound), finding, certain)


def _accept(state: Search, option: Option[Found], measured: DriverData) -> tuple[Search, bool]:
    """Take an effect into the model, and whether the search goes on."""
    step, finding = option.step, option.found
    if isinstance(finding, pedal_holds.Holds):
        # what is decided between two movements of the pedal is not seen: nothing finer can be found after that
        state = with_holds(state, step, finding)
        return _estimated(state, _ceiling_level(finding, state.data)), not step.effect.intermittent
    if isinstance(finding, RandomWalk):
        return _with_random_walk(state, step, finding), True
    if Detector.PEDAL_CEILING in step.effect.detectors and state.data.pedal:
        # at the ceiling the noise goes one way only: samples there are explained by the limit alone
        y = measured.output.y
        level = float(finding.solved.q[finding.solved.model.where[-1].start])
        at = state.data.output.usable & (y >= level - 0.5 * movement_rhythm.step_size(y))
        spans = pedal_holds.standing(at, state.data.output.dt)
        ceiling = pedal_holds.Holds(Detector.PEDAL_CEILING, spans, step.evidence, level)
        state = with_holds(state, step, ceiling)
        return _estimated(state, _ceiling_level(ceiling, state.data)), True
    state = with_curve(state, step, finding, noise_law.again)
    state = state._replace(solved=local_minima.deepest(state.data, state.solved))
    return _estimated(state, _rhythm(step.effect, state.solved, state.data)), True


def with_curve(
    state: CauseSearch[D, M],
    step: Step,
    candidate: Candidate[M],
    rescaled: Callable[[D, FittedModel[M]], FittedModel[M]],
) -> CauseSearch[D, M]:
    """Take a fitted cause into the model, and fit the noise scale again, now that the cause is out of it."""
    return _named(state, step)._replace(solved=rescaled(state.data, candidate.solved))


def _named(
    state: CauseSearch[D, M],
    step: Step,
    episodes: tuple[tuple[float, float], ...] = (),
    level: float = np.nan,
) -> CauseSearch[D, M]:
    named = Named(step.effect, step.evidence, step.needed, (), episodes, None, level)
    return state._replace(named=(*state.named, named))


def _estimated(state: Search, estimate: Interval | None) -> Search:
    """Add the estimate of the cause that was named last."""
    *before, last = state.named
    return state._replace(named=(*before, last._replace(estimate=estimate)))


def _with_random_walk(state: Search, step: Step, walk: RandomWalk) -> Search:
    """Subtract the random walk of the desired headway from the output."""
    solved, output = state.solved, state.data.output
    data = state.data._replace(output=output._replace(y=output.y - walk.added))
    answered = float(solved.q[K1])
    solved = solve(data, solved.model, solved.q, walk.noise, solved.rows)
    # without the walk the gain on headway is larger: the same pedal is a smaller change of the desired headway
    ratio = min(abs(answered / float(solved.q[K1])), 1.0) if solved.q[K1] else 1.0
    estimate = Interval(*(ratio * value for value in walk.sd))
    state = _named(state, step)._replace(data=data, solved=solved, random_walk=walk)
    return _estimated(state, estimate)


def with_holds(state: CauseSearch[D, M], step: Step, holds: pedal_holds.Holds) -> CauseSearch[D, M]:
    """Take what was seen in the output itself out of what is fitted."""
    data, solved = without_holds(state.data, state.solved, holds)
    t, dt = data.t, data.output.dt
    spans = tuple((float(t[a]), float(t[b - 1]) + dt) for a, b in holds.episodes)
    state = state._replace(data=data, solved=solved, holds=(*state.holds, holds))
    return _named(state, step, spans, holds.level)


def _tried(
    curves: tuple[Effect, ...], data: DriverData, solved: FittedDriver, least: float = 0.0
) -> tuple[FittedDriver, list[DriverCandidate]]:
    """Try the parametric causes; where a fit shows that the model without it had ended in a local minimum, try again."""
    fitted = driver_candidates.candidates(curves, data, solved, least)
    if fitted:
        best = max(
            fitted,
            key=lambda candidate: candidate.evidence - EVIDENCE_PER_PARAMETER * candidate.parameters,
        )
        k = solved.q.size
        again = solve(data, solved.model, best.solved.q[:k], best.solved.noise, solved.rows)
        better = again.deviance < solved.deviance - MIN_DEVIANCE_GAIN
        if better and not simulates_worse(data, again, solved):
            return again, driver_candidates.candidates(curves, data, again, least)
    return solved, fitted


def _rhythm(effect: Effect, solved: FittedDriver, data: DriverData) -> Interval | None:
    """Interval of the rhythm: outside of it the decisions are out of step at one end of the drive."""
    if Detector.INTERMITTENT_CONTROL not in effect.detectors:
        return None
    interval = float(solved.q[solved.model.where[-1].start])
    off = IN_STEP_SHARE * interval**2 / max(data.seen.duration, 1.0)
    return Interval(interval, interval - off, interval + off)


def _ceiling_level(holds: pedal_holds.Holds, data: DriverData) -> Interval | None:
    if holds.pattern is Detector.PEDAL_CEILING:
        half = movement_rhythm.step_size(data.output.y[data.output.usable])
        # a soft limit lies a little above the highest level reached
        return Interval(holds.level, holds.level - half, holds.level + max(half, 0.5 * SOFT_LIMIT_PERCENT))
    return None


def without_holds(data: D, solved: FittedModel[M], holds: pedal_holds.Holds) -> tuple[D, FittedModel[M]]:
    """Take the episodes out of what is fitted: masked, or at a ceiling, where the demand is only known to be above."""
    n = data.output.y.size
    at = np.zeros(n, dtype=bool)
    edge = round(EPISODE_EDGE_S / data.output.dt) if holds.pattern is not Detector.PEDAL_CEILING else 0
    for start, stop in holds.episodes:
        at[max(start - 1, 0) : min(stop + edge, n)] = True
    output = data.output
    if holds.pattern is Detector.PEDAL_CEILING:
        # a soft limit bends the pedal before it stops it: above this level only the limit counts
        from_here = holds.level - max(0.5 * movement_rhythm.step_size(output.y), SOFT_LIMIT_PERCENT)
        above = output.usable & ~output.below & (output.y >= from_here)
        output = output._replace(above=above, ceiling=from_here)
    elif holds.pattern is Detector.PEDAL_HOLDS:
        output = output._replace(usable=output.usable & ~at, below=output.below & ~at)
    data = data.with_output(output)
    rows = likelihood.counted(output, solved.noise.A.size - 1)
    if int(rows.sum()) < MIN_ROWS:
        return data, solved
    return data, solve(data, solved.model, solved.q, solved.noise, rows)
