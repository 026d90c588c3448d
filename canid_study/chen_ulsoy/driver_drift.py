"""Does the driver change over the drive? Local-level model of the four parameters over the segments (Harvey 1989, ch. 4).

theta_k = level_k + e_k with the covariance R_k of each minute's fit; the level's change from one minute to the next has the
covariance q times the mean R, the same for every combination of parameters in units of its own error. The likelihood
ratio against a constant level sees the *order* of the minutes, which a standard deviation does not; its null is simulated
with the same R_k, and does not depend on the level.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import local_level
from canid.mathematics.identification.confidence import CHI_SQUARED_QUANTILE, NORMAL_QUANTILE
from canid.values.types import Array, Interval

# standard deviations of the level over the drive that are tried, in standard errors of a segment: as
# mathematics/identification/local_level.py does, less finely, since a band averages over them
_SD_GRID = (0.03, 30.0, 20)
# simulated drives of a constant driver: p values to 0.005
SIMULATIONS = 199
# share of the likelihood below which a q changes no band
_MIN_WEIGHT = 1e-2


class Drift(NamedTuple):
    """Parameters over a drive."""

    number: npt.NDArray[np.int64]  # (n,) segments, from the first to the last; without gaps
    level: Array  # (n, 4) smoothed
    low: Array  # (n, 4) 95 % band
    high: Array  # (n, 4)
    statistic: float  # likelihood ratio against a constant driver
    p_value: float
    variation: Interval  # standard deviation of the level over the drive, in standard errors of one segment


def drift_of(number: npt.NDArray[np.int64], theta: Array, covariances: Array, seed: int = 0) -> Drift | None:
    """Fit the model.

    Args:
        number: (m,) of the segments, rising; the numbers between are missing.
        theta: (m, d) fits.
        covariances: (m, d, d) of their errors.
        seed: of the simulated null.

    Returns:
        None where there are fewer segments than `local_level.MIN_WINDOWS`.

    >>> rng = np.random.default_rng(1)
    >>> R = np.tile(0.04 * np.eye(2), (40, 1, 1))
    >>> drift = drift_of(np.arange(40), 1.0 + 0.2 * rng.normal(size=(40, 2)), R)
    >>> drift.p_value > 0.01
    True
    """
    m, d = theta.shape
    if m < local_level.MIN_WINDOWS:
        return None
    n = int(number[-1] - number[0]) + 1
    at = number - number[0]
    values, R = np.full((n, d), np.nan), np.broadcast_to(covariances.mean(axis=0), (n, d, d)).copy()
    values[at], R[at] = theta, covariances
    # a random walk's sample variance over n steps is on average n / 6 of a step's
    of_drive = np.concatenate([[0.0], np.geomspace(*_SD_GRID)])
    q = 6.0 / max(n - 1, 1) * of_drive**2
    shape = np.median(covariances, axis=0) if d == 1 else covariances.mean(axis=0)
    change = np.broadcast_to((q[:, None, None] * shape)[:, None], (len(q), n - 1, d, d))
    likelihood = local_level.log_likelihood_of_vectors(values, R, change)
    statistic = 2.0 * float(likelihood.max() - likelihood[0])
    root = np.linalg.cholesky(R)
    noise = np.random.default_rng(seed).standard_normal((SIMULATIONS, n, d))
    drawn = np.einsum("nij,snj->sni", root, noise)
    drawn[:, ~np.isfinite(values).all(axis=1)] = np.nan
    null = local_level.log_likelihood_of_vectors(drawn, R, change)
    simulated = 2.0 * (null.max(axis=1) - null[:, 0])
    p_value = (1.0 + float(np.sum(simulated >= statistic))) / (SIMULATIONS + 1.0)
    weight = np.exp(likelihood - likelihood.max()) * np.gradient(of_drive)
    weight /= weight.sum()
    level, square, share = np.zeros((n, d)), np.zeros((n, d)), 0.0
    for w, each in zip(weight, change, strict=True):
        if w > _MIN_WEIGHT:
            mean, of_mean = local_level.smoothed_vectors(values, R, each)
            level += w * mean
            square += w * (np.einsum("nii->ni", of_mean) + mean * mean)
            share += w
    level /= share
    spread = NORMAL_QUANTILE * np.sqrt(np.maximum(square / share - level * level, 0.0))
    possible = of_drive[2.0 * (likelihood.max() - likelihood) <= CHI_SQUARED_QUANTILE]
    return Drift(
        np.arange(number[0], number[-1] + 1),
        level,
        level - spread,
        level + spread,
        statistic,
        p_value,
        Interval(float(of_drive[int(np.argmax(likelihood))]), float(possible.min()), float(possible.max())),
    )
