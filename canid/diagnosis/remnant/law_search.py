"""Which effects the law of the innovations needs: backward elimination from the law with all of them.

Each effect is judged next to all others: a Gaussian likelihood takes any heavy tail for a scale that varies, and any
varying scale for a heavy tail. Innovations are martingale differences, so likelihood ratios need no correction for
autocorrelation, and 1/ν at its bound makes the one for heavy tails smaller than chi-squared says (Chernoff 1954).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.diagnosis.fitting.robust_covariance import needed
from canid.diagnosis.fitting.search import RIVAL
from canid.diagnosis.remnant import law_fit
from canid.diagnosis.remnant.innovations import Innovations
from canid.diagnosis.remnant.law_fit import FittedLaw
from canid.effects.effect import Effect
from canid.findings import Flags
from canid.types import Array


class Judged(NamedTuple):
    """One effect next to those that were in the law with it."""

    effect: Effect
    evidence: float  # 2 Δ log likelihood over the law without it
    needed: float


def features_of(of: Innovations, effects: Sequence[Effect], rows: Flags) -> Array:
    """Features of the scale (k, rows): those of the effects in their order, then what every law has."""
    own = [of.features[feature] for effect in effects if effect.remnant for feature in effect.remnant.scale]
    return np.vstack([*own, of.present])[:, rows]


def fitted(
    of: Innovations, effects: Sequence[Effect], rows: Flags, inverse: float | None = None
) -> FittedLaw:
    """Fit the law with some effects to some rows."""
    heavy = any(effect.remnant is not None and effect.remnant.heavy_tailed for effect in effects)
    return law_fit.fit(of.x[rows], features_of(of, effects, rows), heavy=heavy, inverse=inverse)


def without(effects: Sequence[Effect], gone: Effect) -> tuple[Effect, ...]:
    """All effects but one."""
    return tuple(effect for effect in effects if effect is not gone)


def eliminated(
    of: Innovations, effects: tuple[Effect, ...], tried: int
) -> tuple[tuple[Effect, ...], list[Judged]]:
    """Drop the effects that the law does not need, the weakest first.

    Args:
        of: the innovations.
        effects: all that may be in the law.
        tried: candidates of the whole diagnosis of the driver; the threshold accounts for all.

    Returns:
        the effects that stay, and each effect as it was judged last.
    """
    judged: dict[str, Judged] = {}
    while effects:
        most = fitted(of, effects, of.rows).log_likelihood
        for effect in effects:
            lost = most - fitted(of, without(effects, effect), of.rows).log_likelihood
            judged[effect.id] = Judged(effect, max(2.0 * lost, 0.0), needed(len(effect.parameters), tried))
        weakest = min((judged[effect.id] for effect in effects), key=lambda one: one.evidence - one.needed)
        if weakest.evidence > weakest.needed:
            break
        effects = without(effects, weakest.effect)
    return effects, list(judged.values())


def rivals(
    of: Innovations, kept: tuple[Effect, ...], one: Effect, others: Sequence[Effect]
) -> tuple[str, ...]:
    """Effects that explain the innovations as well in the place of one that was kept."""
    most = fitted(of, kept, of.rows).log_likelihood
    rest = without(kept, one)
    return tuple(
        other.id
        for other in others
        if other not in kept and 2.0 * (most - fitted(of, (*rest, other), of.rows).log_likelihood) < RIVAL
    )
