"""One more effect in a model: screened along its direction, fitted from its best initial guesses, priced by its evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Generic, NamedTuple

import numpy as np
from scipy.linalg import qr

from canid.models.diagnosis.fitting.fitted_model import FittedModel, M, dropped, extended, solve
from canid.models.diagnosis.fitting.likelihood import whitened
from canid.models.diagnosis.fitting.model import Columns, place
from canid.models.diagnosis.fitting.search import RIVAL, Named, Step
from canid.models.diagnosis.fitting.uncertainty import inflation, needed
from canid.models.effects.effect import Effect, Kind
from canid.values.findings import RivalCause
from canid.values.types import Array, Interval

# a candidate whose direction explains less than this is not fitted: a full fit finds a little more than its
# direction at an initial guess, but not four times as much
MIN_EXPLAINED = 3.0
# evidence from which on a candidate may win, and its fit is polished
POLISH_EVIDENCE = 8.0
# evidence per parameter: of two candidates, the one with more of them must explain more by so much
EVIDENCE_PER_PARAMETER = 6.0
# of the evidence of a dependence on time, that one on the operating point may not reach: neither has the exact form of
# the driver's law, so the better of two approximations may be the wrong one
TIMELESS_SHARE = 0.5
# of the simulation's error variance, that a likelier model may lose on the data that it is fitted to
MAX_SIMULATION_LOSS = 0.25
# of a parameter's range; nearer than this it stands at its bound
BOUND_RANGE_SHARE = 1e-3
# of a cause's evidence that a rival must have had at some step to be fitted again
RIVAL_SHARE = 0.3
# squared length of a whitened direction; shorter is rounding of what the model itself can take up
ROUNDING = 1e-9


class Candidate(NamedTuple, Generic[M]):
    """One effect added to a model."""

    effect: Effect
    solved: FittedModel[M]
    evidence: float  # 2 Δ log likelihood over the model without it, robust
    parameters: int  # that it added


class Guess(NamedTuple):
    """An initial guess, and what its direction explains there."""

    q: Array
    explains: float


def model_directions(without: FittedModel[M]) -> Array:
    """Orthonormal columns (n, k) of what a model's own parameters can take up, whitened."""
    Q: Array = qr(without.fitted.jacobian, mode="economic")[0]
    return Q


def direction(data: Columns, without: FittedModel[M], Q: Array, change: Array) -> Array:
    """Whitened change of the residual (n,) by a change of the output (n,), without what the model can take up.

    Args:
        data: what is explained.
        without: the model.
        Q: its directions, from `model_directions`.
        change: (n,) output unit.
    """
    d = whitened(without.noise, change) * without.fitted.scored.slope
    out: Array = d - Q @ (Q.T @ d)
    return out


def screened(effect: Effect, data: Columns, without: FittedModel[M], guesses: Iterable[Array]) -> list[Guess]:
    """Price every initial guess by what its direction explains of the residual."""
    model, Q = extended(without.model, effect), model_directions(without)
    function, e = model.bind(data, without.noise), without.fitted.scored.e
    out = []
    for q in guesses:
        d = direction(data, without, Q, function(q) - without.fitted.model)
        size, along = float(d @ d), float(d @ e)
        # −e·d is how far along the direction the residual lies
        useful = size > ROUNDING and (along < 0 or not model.one_signed)
        out.append(Guess(q, along * along / size if useful else 0.0))
    return out


def best_fit(
    effect: Effect, data: Columns, without: FittedModel[M], guesses: Iterable[Array]
) -> FittedModel[M]:
    """Fit one more effect from several initial guesses; the likeliest."""
    model = extended(without.model, effect)
    fits = (solve(data, model, q, without.noise, without.rows) for q in guesses)
    return min(fits, key=lambda fitted: fitted.deviance)


def price(effect: Effect, solved: FittedModel[M], without: FittedModel[M], dt: float) -> Candidate[M]:
    """Evidence of any effect of a model, over the model without it."""
    where = place(solved.model, effect.id)
    gained = max(without.deviance - solved.deviance, 0.0)
    added = len(solved.fitted.free) - len(without.fitted.free)
    moved = [k for k in range(where.start, where.stop) if k in solved.fitted.free]
    return Candidate(effect, solved, gained / (inflation(solved.fitted, moved, dt) if moved else 1.0), added)


class Kept(NamedTuple, Generic[M]):
    """A model whose effects are all needed."""

    solved: FittedModel[M]
    evidence: dict[str, float]  # effect id -> over the model without it
    without: dict[str, FittedModel[M]]  # effect id -> the model without it; {}: nothing was left out


def needed_still(data: Columns, solved: FittedModel[M], tried: int) -> Kept[M]:
    """Drop the effects that the others, or the noise fitted next to them, have made superfluous, the weakest first.

    An effect that stays is needed under the likelihood that its intervals are of: none of them holds "no effect".

    Args:
        data: what is explained.
        solved: the model.
        tried: candidates of the whole search.
    """
    evidence: dict[str, float] = {}
    while solved.model.effects:
        without = {effect.id: dropped(data, solved, effect.id) for effect in solved.model.effects}
        priced = [
            price(effect, solved, without[effect.id], data.output.dt) for effect in solved.model.effects
        ]
        evidence |= {candidate.effect.id: candidate.evidence for candidate in priced}
        weakest = min(priced, key=lambda candidate: candidate.evidence - needed(candidate.parameters, tried))
        if weakest.evidence > needed(weakest.parameters, tried):
            return Kept(solved, evidence, without)
        solved = without[weakest.effect.id]
    return Kept(solved, evidence, {})


def still_named(named: Sequence[Named], kept: Kept[M]) -> list[Named]:
    """Names whose effects are still needed, with the evidence next to the others; of one alone never more than it had."""
    alone, out = len(kept.evidence) == 1, []
    for cause in named:
        evidence = kept.evidence.get(cause.effect.id, cause.evidence)
        if cause.effect.id not in kept.evidence or cause.effect in kept.solved.model.effects:
            out.append(cause._replace(evidence=min(evidence, cause.evidence) if alone else evidence))
    return out


def with_rivals(
    cause: Named,
    data: Columns,
    kept: Kept[M],
    steps: Sequence[Step],
    swaps: Callable[[set[str], FittedModel[M]], Sequence[Candidate[M]]],
) -> Named:
    """Name the causes that explain as much in place of one of them.

    Args:
        cause: the cause.
        data: what is explained.
        kept: the model with it.
        steps: of the search.
        swaps: fits the others, by their ids, each added to a model without it.
    """
    solved = kept.solved
    have = {effect.id for effect in solved.model.effects}
    # only candidates that explained a part of it at an earlier step
    worth = {step.effect.id for step in steps if step.evidence > RIVAL_SHARE * cause.evidence} - have
    if cause.effect.id not in have or cause.effect.kind is not Kind.PARAMETRIC or not worth:
        return cause._replace(rivals=cause.effect.rivals)
    left = kept.without.get(cause.effect.id) or dropped(data, solved, cause.effect.id)
    bound = {step.effect.id: step.needed for step in steps}
    # a cause with more to choose must explain as much more as that finds by chance
    close = {
        c.effect.id: c.solved
        for c in swaps(worth, left)
        if c.solved.deviance - solved.deviance < RIVAL + max(cause.needed - bound[c.effect.id], 0.0)
    }
    return cause._replace(rivals=tuple(dict.fromkeys([*cause.effect.rivals, *close])), in_place=close)


def rival_causes(
    cause: Named,
    parameters: Callable[[FittedModel[Any], Effect], Mapping[str, Interval]],
    in_unit: Callable[[str], str] = str,
) -> tuple[RivalCause, ...]:
    """Sizes of the rivals of a cause that were fitted in its place.

    Args:
        cause: with its rivals.
        parameters: model, one of its effects -> name -> interval.
        in_unit: puts the output's unit into a text.
    """
    each = []
    for rival in cause.rivals:
        for effect in cause.in_place[rival].model.effects if rival in cause.in_place else ():
            if effect.id == rival:
                units = {p.name: in_unit(p.unit) for p in effect.parameters}
                each.append(RivalCause(rival, parameters(cause.in_place[rival], effect), units))
    return tuple(each)


def at_bound(candidate: Candidate[M]) -> bool:
    """Is a fitted strength at its physical bound? Then it stands for another cause."""
    solved = candidate.solved
    where = place(solved.model, candidate.effect.id)
    for p, k in zip(candidate.effect.parameters, range(where.start, where.stop), strict=True):
        near = BOUND_RANGE_SHARE * (p.high - p.low)
        limits = [limit for limit in (p.low, p.high) if limit != 0.0 and p.unit != "rad"]
        if k in solved.fitted.free and any(abs(float(solved.q[k]) - limit) < near for limit in limits):
            return True
    return False


def is_operating_point(
    candidate: Candidate[M], without: FittedModel[M], tried: Callable[[Effect], Candidate[M] | None]
) -> bool:
    """Does the same freedom, given to the operating point, explain as much as this dependence on time?

    A time-invariant driver whose speed changes changes with the operating point alone.

    Args:
        candidate: the dependence on time.
        without: the model without it.
        tried: fits another cause in its place; None: it explains nothing.
    """
    if candidate.evidence < POLISH_EVIDENCE:
        return False
    won = without.deviance - candidate.solved.deviance
    for effect in candidate.effect.timeless:
        other = tried(effect)
        if other is None:
            continue
        handicap = EVIDENCE_PER_PARAMETER * max(other.parameters - candidate.parameters, 0)
        if without.deviance - other.solved.deviance - handicap > min(won - RIVAL, TIMELESS_SHARE * won):
            return True
    return False


def simulates_worse(data: Columns, extended_fit: FittedModel[M], without: FittedModel[M]) -> bool:
    """Does a model that predicts the next sample better simulate the drive worse than the model without the cause?

    Then it has traded the slow part of the response for the noise model, which explains any slow part: on measured
    drives such fits have gains of ten times the baseline's, and an error variance of up to forty times. The driver's own
    noise is in the inputs through the loop, so the true model may simulate a little worse than a wrong one (by 11 % where
    an IDM driver has K1 0.60 and a constant time headway takes 0.07): a small loss says nothing.
    """
    free = data.output.usable & ~data.output.hidden
    square = [
        float(np.mean((data.output.y - model_fit.fitted.model)[free] ** 2))
        for model_fit in (without, extended_fit)
    ]
    return square[1] > (1 + MAX_SIMULATION_LOSS) * square[0]
