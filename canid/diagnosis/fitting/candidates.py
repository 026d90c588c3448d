"""One more effect in a model: screened along its direction, fitted from its best initial guesses, priced by its evidence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Generic, NamedTuple

from scipy.linalg import qr

from canid.diagnosis.fitting.fitted_model import FIT_TURNS, FittedModel, M, dropped, extended, solve
from canid.diagnosis.fitting.likelihood import whitened
from canid.diagnosis.fitting.model import Columns, place
from canid.diagnosis.fitting.robust_covariance import inflation, needed
from canid.diagnosis.fitting.search import RIVAL, Named, Step
from canid.effects.effect import Effect
from canid.types import Array

# a candidate whose direction explains less than this is not fitted: a full fit finds a little more than its
# direction at an initial guess, but not four times as much
MIN_EXPLAINED = 3.0
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
    function, e = model.bind(data), without.fitted.scored.e
    out = []
    for q in guesses:
        d = direction(data, without, Q, function(q) - without.fitted.model)
        size, along = float(d @ d), float(d @ e)
        # −e·d is how far along the direction the residual lies
        useful = size > ROUNDING and (along < 0 or not model.one_signed)
        out.append(Guess(q, along * along / size if useful else 0.0))
    return out


def best_fit(
    effect: Effect, data: Columns, without: FittedModel[M], guesses: Iterable[Array], turns: int = FIT_TURNS
) -> FittedModel[M]:
    """Fit one more effect from several initial guesses; the likeliest."""
    model = extended(without.model, effect)
    fits = (solve(data, model, q, without.noise, without.rows, turns) for q in guesses)
    return min(fits, key=lambda one: one.deviance)


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


def needed_still(data: Columns, solved: FittedModel[M], tried: int, least: int) -> Kept[M]:
    """Drop the effects that the others have made superfluous, the weakest first.

    Args:
        data: what is explained.
        solved: the model.
        tried: candidates of the whole search.
        least: effects that stay without being tested again.
    """
    evidence: dict[str, float] = {}
    while len(solved.model.effects) > least:
        without = {effect.id: dropped(data, solved, effect.id) for effect in solved.model.effects}
        priced = [
            price(effect, solved, without[effect.id], data.output.dt) for effect in solved.model.effects
        ]
        evidence |= {one.effect.id: one.evidence for one in priced}
        weakest = min(priced, key=lambda one: one.evidence - needed(one.parameters, tried))
        if weakest.evidence > needed(weakest.parameters, tried):
            return Kept(solved, evidence, without)
        solved = without[weakest.effect.id]
    return Kept(solved, evidence, {})


def still_named(named: Sequence[Named], kept: Kept[M]) -> list[Named]:
    """Names whose effects are still needed, with the evidence next to the others."""
    return [
        one._replace(evidence=kept.evidence.get(one.effect.id, one.evidence))
        for one in named
        if one.effect.id not in kept.evidence or one.effect in kept.solved.model.effects
    ]


def with_rivals(
    one: Named, swaps: Sequence[Candidate[M]], solved: FittedModel[M], steps: Sequence[Step]
) -> Named:
    """Name the causes that explain as much in place of one of them.

    Args:
        one: the cause.
        swaps: the others, each fitted without it.
        solved: the model with it.
        steps: of the search.
    """
    bound = {step.effect.id: step.needed for step in steps}
    # a cause with more to choose must explain as much more as that finds by chance
    close = [
        c.effect.id
        for c in swaps
        if c.solved.deviance - solved.deviance < RIVAL + max(one.needed - bound[c.effect.id], 0.0)
    ]
    return one._replace(rivals=tuple(dict.fromkeys([*one.effect.rivals, *close])))
