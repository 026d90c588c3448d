"""Sequential Monte Carlo test: replicates of the null are drawn until the answer is clear (Besag & Clifford 1991).

It is clear against a claim after two replicates at or above the observed value, as then the p-value of 40 exceeds 5 %. It is
clear for the claim before 40 where the observed value lies above what a further replicate may be expected to reach, by
Student's prediction interval for the next observation of a normal sample (Hahn 1969): gains and evidences of a null are
bounded below and skewed, so the level asked for is far beyond 5 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum, auto

import numpy as np
from scipy.stats import t as student

# replicates at most; p-values are multiples of 1/40
MOST = 39
# replicates that are simulated side by side, and how often at most
BATCH = 5
BATCHES = -(-MOST // BATCH)
# at or above the observed value, from which on p > 0.05
EXCEEDANCES = 2
# replicates before which nothing is clear, and chance that the next one would reach the observed value
LEAST, CLEAR_CHANCE = 5, 5e-4
# of the null's distribution that a claim must exceed
LEVEL = 0.95


class Answer(Enum):
    """Does the null give the observed value too?"""

    OPEN = auto()
    NULL = auto()  # it does
    BEYOND = auto()  # it does not


def answer(observed: float, null: Sequence[float]) -> Answer:
    """Compare an observed value with replicates of the null.

    Args:
        observed: large values speak against the null.
        null: values of the replicates so far.

    Example:
        >>> answer(0.1, [0.2, 0.0, 0.3]), answer(9.0, [0.2, 0.0, 0.3, 0.1, 0.2]), answer(0.4, [0.2, 0.0, 0.3, 0.1, 0.2])
        (<Answer.NULL: 2>, <Answer.BEYOND: 3>, <Answer.OPEN: 1>)
    """
    n = len(null)
    if sum(value >= observed for value in null) >= EXCEEDANCES:
        return Answer.NULL
    if n >= MOST:
        return Answer.BEYOND
    if n >= LEAST:
        away = (observed - float(np.mean(null))) / max(float(np.std(null, ddof=1)), 1e-12)
        if away / math.sqrt(1 + 1 / n) > float(student.isf(CLEAR_CHANCE, n - 1)):
            return Answer.BEYOND
    return Answer.OPEN


def point(null: Sequence[float], level: float = LEVEL) -> float:
    """Quantile of the null: of few replicates by Student's prediction interval, of many by their order; NaN: too few.

    Example:
        >>> point([0.0, 0.1, 0.2, 0.1, 0.1]) > 0.2
        True
    """
    n = len(null)
    if n < 2:
        return math.nan
    if n >= 20:
        return float(np.quantile(null, level, method="higher"))
    wide = float(student.isf(1 - level, n - 1)) * math.sqrt(1 + 1 / n)
    return float(np.mean(null) + wide * np.std(null, ddof=1))
