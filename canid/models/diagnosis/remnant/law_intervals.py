"""95 % intervals of a law: profile likelihood of ν (Venzon & Moolgavkar 1988), robust ones of the slopes (White 1982)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from canid.mathematics.identification.confidence import SIGMAS
from canid.models.diagnosis.remnant import law_search
from canid.models.diagnosis.remnant.innovations import Innovations
from canid.models.diagnosis.remnant.law_search import (
    MAX_INVERSE,
    MAX_LOG_SCALE,
    MIN_INVERSE,
    FittedLaw,
    scores,
)
from canid.models.effects.effect import Effect
from canid.values.types import Array, Interval


def parameters(
    innovations: Innovations, effects: Sequence[Effect], best: FittedLaw
) -> dict[str, dict[str, Interval]]:
    """Intervals of every effect's parameters: effect id -> name -> interval.

    Args:
        innovations: the innovations.
        effects: of the law, in the order of its slopes.
        best: the law, fitted to all rows.
    """
    sd = slope_sds(innovations, effects, best)
    out: dict[str, dict[str, Interval]] = {}
    k = 0
    for effect in effects:
        assert effect.remnant is not None
        names = [parameter.name for parameter in effect.parameters]
        out[effect.id] = {}
        if effect.remnant.heavy_tailed:
            out[effect.id][names.pop(0)] = freedom(innovations, effects, best)
        for name in names:
            value, half = float(best.law.slopes[k]), SIGMAS * float(sd[k])
            out[effect.id][name] = Interval(value, value - half, value + half)
            k += 1
    return out


def freedom(innovations: Innovations, effects: Sequence[Effect], best: FittedLaw) -> Interval:
    """Degrees of freedom; each end at which the likelihood, all else refitted, has fallen by what 95 % allows."""

    def fallen(inverse: float) -> float:
        held = law_search.fitted(innovations, effects, innovations.rows, inverse)
        return 2.0 * (best.log_likelihood - held.log_likelihood) - SIGMAS**2

    at = 1.0 / best.law.freedom
    few = brentq(fallen, at, MAX_INVERSE, rtol=1e-2) if fallen(MAX_INVERSE) > 0 else MAX_INVERSE
    many = brentq(fallen, MIN_INVERSE, at, rtol=1e-2) if fallen(MIN_INVERSE) > 0 else 0.0
    return Interval(best.law.freedom, 1.0 / float(few), 1.0 / float(many) if many > 0 else math.inf)


def slope_sds(innovations: Innovations, effects: Sequence[Effect], best: FittedLaw) -> Array:
    """Standard deviations of the slopes (k,): sandwich of expected information and the scores' own spread."""
    F = law_search.features_of(innovations, effects, innovations.rows)
    law, F1 = best.law, np.vstack([np.ones(F.shape[1]), F])
    inverse = 1.0 / law.freedom
    relative = np.clip(law.slopes @ F, -MAX_LOG_SCALE, MAX_LOG_SCALE)
    z2 = (innovations.x[innovations.rows] * np.exp(-relative) / law.sd) ** 2
    g = F1 * scores(z2, inverse)
    # Fisher's information of a log scale: 2ν/(ν + 3), of a Gaussian 2
    bread = np.linalg.pinv(2.0 / (1.0 + 3.0 * inverse) * (F1 @ F1.T))
    robust = bread @ (g @ g.T) @ bread
    return np.asarray(np.sqrt(np.maximum(np.diag(robust), np.diag(bread)))[1:])
