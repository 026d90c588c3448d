"""Gain of a law in one-step log score on held-out data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.models.diagnosis.fitting.log_score_gain import gain
from canid.models.diagnosis.remnant import law_search
from canid.models.diagnosis.remnant.innovations import Innovations
from canid.models.diagnosis.remnant.law_search import log_density
from canid.models.effects.effect import Effect
from canid.values.types import Array, Interval


class HeldOut(NamedTuple):
    """Gains on the quarters of the drive that did not fit the law."""

    law: Interval  # of the whole law over a Gaussian of the present scale
    each: dict[str, Interval]  # effect id -> over the law without it


def held_out(innovations: Innovations, effects: Sequence[Effect], fold: npt.NDArray[np.int64]) -> HeldOut:
    """Score the law on each fold as fitted to the others.

    Args:
        innovations: the innovations.
        effects: of the law.
        fold: (n,) fold of each sample.
    """
    whole = scores(innovations, effects, fold)
    return HeldOut(
        gain(whole - scores(innovations, (), fold), innovations.rows, innovations.dt),
        {
            effect.id: gain(
                whole - scores(innovations, law_search.without(effects, effect), fold),
                innovations.rows,
                innovations.dt,
            )
            for effect in effects
        },
    )


def scores(innovations: Innovations, effects: Sequence[Effect], fold: npt.NDArray[np.int64]) -> Array:
    """Log density of each innovation (n,) by the law of the other folds; 0 where it does not count."""
    out = np.zeros(innovations.x.size)
    for k in np.unique(fold):
        here, train = innovations.rows & (fold == k), innovations.rows & (fold != k)
        if here.any() and train.any():
            law = law_search.fitted(innovations, effects, train).law
            out[here] = log_density(
                law, innovations.x[here], law_search.features_of(innovations, effects, here)
            )
    return out
