"""Score test of columns that a model has not, by scores that hold under uneven noise (White 1980; Newey & West 1987)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from canid.models.diagnosis.fitting.uncertainty import newey_west
from canid.values.types import Array

# directions that are smaller than this share of the largest hold nothing of their own
INDEPENDENT = 0.05
# length of whitened columns below which they hold nothing at all
ROUNDING = 1e-9


class ScoreTest(NamedTuple):
    """What the score of some columns says."""

    p: float  # chance of more, of all directions together
    best: float  # of the best column alone, all columns counted
    statistic: float
    variance_inflation: float  # how much wider the score spreads than in even noise, at least 1
    gain: float  # squared score: twice the log likelihood that the columns would gain in even noise
    expected: float  # of it by chance, as the score really spreads


def independent(X: Array) -> Array:
    """Return the matrix (m, k) that turns columns X (n, m) into orthonormal directions, small ones left out."""
    # singular values and right vectors; the squares keep six digits of what is kept
    square, V = np.linalg.eigh(X.T @ X)
    S = np.sqrt(np.maximum(square, 0.0))
    kept = INDEPENDENT * S[-1] < S if S.size and S[-1] > ROUNDING else np.zeros(S.size, dtype=bool)
    turn: Array = V[:, kept] / S[kept]
    return turn


def score_test(X: Array, turn: Array, e: Array, lags: int) -> ScoreTest:
    """Test whether whitened residuals of variance 1 hold anything of some columns.

    Args:
        X: (n, m) whitened, without what the model can take up.
        turn: (m, k) columns -> orthonormal directions, from `independent`; k at least 1.
        e: (n,) whitened residuals.
        lags: samples after which scores are independent.
    """
    score, each = X.T @ e, newey_west(X * e[:, None], lags)
    # the larger of both spreads in each direction: neither few blocks nor an even noise may make a finding
    alone = score**2 / np.maximum(np.diag(each), 1.0)
    best = min(1.0, score.size * float(chi2.sf(float(alone.max()), 1)))
    meat, z = turn.T @ each @ turn, turn.T @ score
    values, vectors = np.linalg.eigh(meat)
    statistic = float(np.sum((vectors.T @ z) ** 2 / np.maximum(values, 1.0)))
    return ScoreTest(
        float(chi2.sf(statistic, turn.shape[1])),
        best,
        statistic,
        max(float(values.mean()), 1.0),
        float(z @ z),
        float(np.maximum(values, 1.0).sum()),
    )
