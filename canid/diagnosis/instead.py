"""What explains more than the wish that wanders: a wander takes what any slow answer leaves, and is named for it.

A random walk with a step every half minute follows whatever is slow. What the headway of long ago, a bend or a limit of the
foot's speed explains by a few numbers it explains by many, and less of it. So the drive is held against every family once
more with the wander put back; a wish that does wander is explained by itself better than by any of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from canid.diagnosis.families import LEVEL_FAMILY, Shapes
from canid.diagnosis.naming import Search
from canid.diagnosis.recoloured import beside, directions, remembered


class Instead(NamedTuple):
    """What explains more than the wander that was named."""

    says: str
    p: float  # chance that a family explains so much more, all counted
    statistic: float  # 2 Δ log likelihood, beyond the wander's
    dimensions: int
    share: float  # of the residual's variance, that the wander took


def look(found: Search, families: list[Shapes]) -> Instead | None:
    """Hold every family against the wander; None: none was named.

    Args:
        found: what the search ended with.
        families: along this drive.
    """
    if found.wander is None:
        return None
    solved, added = found.solved, found.wander.added
    back = found.data._replace(output=found.data.output._replace(y=found.data.output.y + added))
    own = directions(back, solved)
    memory = remembered(solved)
    plain = beside(back, solved, own, memory).deviance

    def wins(family: Shapes) -> float:
        length = np.maximum(np.linalg.norm(family.columns, axis=0), 1e-12)
        return plain - beside(back, solved, np.column_stack([own, family.columns / length]), memory).deviance

    others = [one for one in families if not one.in_time]
    level = max(wins(one) for one in families if one.name == LEVEL_FAMILY)
    told = next(one.evidence for one in found.named if one.effect.id == "headway_drift")
    # what the wander wins: as it was fitted, as it was priced, and as free as a level can be
    of_wander = max(plain - beside(found.data, solved, own, memory).deviance, told, level, 0.0)
    best = Instead("an answer that explains more than a wish that wanders", 1.0, 0.0, 0, 0.0)
    rows = solved.rows & ~found.data.output.hidden
    left = float(np.var((found.data.output.y - solved.fitted.model)[rows]))
    share = float(np.var(added[rows])) / max(float(np.var(added[rows])) + left, 1e-12)
    for family in others:
        k, more = family.columns.shape[1], wins(family) - of_wander
        p = float(chi2.sf(more, k)) if k and more > 0 else 1.0
        if p < best.p:
            says = f"{family.says}, which explains more than a wish that wanders"
            best = Instead(says, p, more, k, share)
    return best._replace(p=min(1.0, best.p * max(len(others), 1)))
