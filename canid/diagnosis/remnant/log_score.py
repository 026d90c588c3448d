"""Gain of a law in one-step log score on held-out data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.diagnosis.fitting.log_score_gain import gain
from canid.diagnosis.remnant import law_search
from canid.diagnosis.remnant.innovations import Innovations
from canid.diagnosis.remnant.law_fit import log_density
from canid.effects.effect import Effect
from canid.types import Array, Interval


class HeldOut(NamedTuple):
    """Gains on the quarters of the drive that did not fit the law."""

    law: Interval  # of the whole law over a Gaussian of the present scale
    each: dict[str, Interval]  # effect id -> over the law without it


def held_out(of: Innovations, effects: Sequence[Effect], fold: npt.NDArray[np.int64]) -> HeldOut:
    """Score the law on each fold as fitted to the others.

    Args:
        of: the innovations.
        effects: of the law.
        fold: (n,) fold of each sample.
    """
    whole = scores(of, effects, fold)
    return HeldOut(
        gain(whole - scores(of, (), fold), of.rows, of.dt),
        {
            effect.id: gain(whole - scores(of, law_search.without(effects, effect), fold), of.rows, of.dt)
            for effect in effects
        },
    )


def scores(of: Innovations, effects: Sequence[Effect], fold: npt.NDArray[np.int64]) -> Array:
    """Log density of each innovation (n,) by the law of the other folds; 0 where it does not count."""
    out = np.zeros(of.x.size)
    for k in np.unique(fold):
        here, train = of.rows & (fold == k), of.rows & (fold != k)
        if here.any() and train.any():
            law = law_search.fitted(of, effects, train).law
            out[here] = log_density(law, of.x[here], law_search.features_of(of, effects, here))
    return out
