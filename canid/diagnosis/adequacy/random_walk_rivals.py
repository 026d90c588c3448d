"""Alternatives to a random walk of the desired headway that explain more than it does.

A random walk with a step every half minute follows any slow residual. What the headway of long ago, a bend or a limited
rate of the pedal explains by a few parameters, it explains by many, and less of it. So every family is tested once more
with the random walk put back into the output; a true random walk explains more than any of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from canid.diagnosis.adequacy.alternatives import LEVEL_FAMILY, Shapes
from canid.diagnosis.adequacy.refit_noise import directions, noise_memory, refit
from canid.diagnosis.driver.driver_search import Search
from canid.effects.effect import Detector


class Rival(NamedTuple):
    """The alternative that explains most beyond the random walk that was named."""

    says: str
    p: float  # chance that a family explains so much more, all counted
    statistic: float  # 2 Δ log likelihood, beyond the random walk's
    dimensions: int
    share: float  # of the residual's variance, that the random walk took


def best_rival(found: Search, families: list[Shapes]) -> Rival | None:
    """Compare every family with the random walk; None: none was named.

    Args:
        found: what the search ended with.
        families: along this drive.
    """
    if found.random_walk is None:
        return None
    solved, added = found.solved, found.random_walk.added
    back = found.data._replace(output=found.data.output._replace(y=found.data.output.y + added))
    own = directions(back, solved)
    memory = noise_memory(solved)
    plain = refit(back, solved, own, memory).deviance

    def wins(family: Shapes) -> float:
        length = np.maximum(np.linalg.norm(family.columns, axis=0), 1e-12)
        return plain - refit(back, solved, np.column_stack([own, family.columns / length]), memory).deviance

    others = [one for one in families if not one.in_time]
    level = max(wins(one) for one in families if one.name == LEVEL_FAMILY)
    evidence = next(one.evidence for one in found.named if Detector.RANDOM_WALK in one.effect.detectors)
    # gain of the random walk: as fitted, as priced, and as a free level
    walk_gain = max(plain - refit(found.data, solved, own, memory).deviance, evidence, level, 0.0)
    best = Rival("an answer that explains more than a random walk of the desired headway", 1.0, 0.0, 0, 0.0)
    rows = solved.rows & ~found.data.output.hidden
    left = float(np.var((found.data.output.y - solved.fitted.model)[rows]))
    share = float(np.var(added[rows])) / max(float(np.var(added[rows])) + left, 1e-12)
    for family in others:
        k, more = family.columns.shape[1], wins(family) - walk_gain
        p = float(chi2.sf(more, k)) if k and more > 0 else 1.0
        if p < best.p:
            says = f"{family.says}, which explains more than a random walk of the desired headway"
            best = Rival(says, p, more, k, share)
    return best._replace(p=min(1.0, best.p * max(len(others), 1)))
