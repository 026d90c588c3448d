"""What a recursion of ARMAX knows of its parameters: the mean of its memories, and its longest one."""

from __future__ import annotations

import numpy as np

from canid.mathematics.identification.armax import forgetting_mixture
from canid.mathematics.identification.armax.armax_recursive import State
from tests.plants.planted_drive import Array


def estimate(state: State) -> tuple[Array, Array]:
    """Return theta (n,) and its covariance (n, n): the mean of the memories, and the covariance within and between them.

    The information of a memory counts samples with exponential weights w; the estimate's variance is that
    with w squared (half of P in the long run), inflated by the autocorrelation of the innovations, as
    residual_tests.long_run_inflation does for a batch.
    """
    shares = np.array(forgetting_mixture.shares(state.trust))
    theta = state.theta[:, 0].astype(np.float64)
    mean: Array = shares @ theta
    away = theta - mean
    w1, w2 = state.weights
    root = state.root.astype(np.float64) * np.sqrt(shares * w2 / w1)[:, None, None]
    within = (root @ root.swapaxes(1, 2)).sum(axis=0) * _variance(state)
    covariance: Array = within + (shares[:, None] * away).T @ away
    return mean, covariance


def longest(state: State) -> tuple[Array, Array, Array]:
    """Return theta (n,) of the longest memory, its covariance now, and that when it began (both (n, n))."""
    root, anchor = state.root[-1].astype(np.float64), state.anchor.astype(np.float64)
    variance = _variance(state)
    return state.theta[-1, 0].astype(np.float64), root @ root.T * variance, anchor @ anchor.T * variance


def _variance(state: State) -> float:
    """Of the innovations, inflated by their autocorrelation and by what their law asks."""
    moving = state.score[1] > 0.0
    ratio = float(np.mean(state.score[0][moving] / state.score[1][moving])) if moving.any() else 1.0
    return state.noise.variance * state.law.inflation * max(1.0, ratio)
