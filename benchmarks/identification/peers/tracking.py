"""Recursive least squares of other packages: generators over (y, u) of k and a1 a2 b1 b2. None has a C polynomial."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.identification.peers.peer import Peer
from benchmarks.identification.peers.regressors import lagged

Steps = Iterator[tuple[int, np.ndarray]]


def _rows(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return np.column_stack([-lagged(y, range(1, 3)), lagged(u, range(1, 3))])


def padasip_steps(y: np.ndarray, u: np.ndarray, forgetting: float) -> Steps:
    from padasip.filters import FilterRLS

    # eps is the inverse of the first covariance
    model = FilterRLS(n=4, mu=forgetting, eps=1e-4, w="zeros")
    for k, row in enumerate(_rows(y, u)):
        if k >= 2:
            model.adapt(y[k], row)
            yield k, np.array(model.w)


def filterpy_steps(y: np.ndarray, u: np.ndarray, drift: float) -> Steps:
    """The parameters as a random walk: `drift` is its variance per sample over the noise's."""
    from filterpy.kalman import KalmanFilter

    model = KalmanFilter(dim_x=4, dim_z=1)
    model.F, model.P, model.Q, model.R = np.eye(4), 1e4 * np.eye(4), drift * np.eye(4), np.eye(1)
    for k, row in enumerate(_rows(y, u)):
        if k >= 2:
            model.H = row[None, :]
            model.predict()
            model.update(y[k])
            yield k, model.x[:, 0].copy()


def river_steps(y: np.ndarray, u: np.ndarray, smoothing: float | None) -> Steps:
    from river.linear_model import BayesianLinearRegression

    # alpha: precision of the prior, nearly none; beta: of the noise
    model = BayesianLinearRegression(alpha=1e-4, beta=1.0, smoothing=smoothing)
    for k, row in enumerate(_rows(y, u)):
        if k >= 2:
            model.learn_one(dict(zip("abcd", row.tolist(), strict=True)), float(y[k]))
            if (k + 1) % 10 == 0 or k == len(y) - 1:
                # without a public name for the weights: what it predicts for each unit vector
                yield (
                    k,
                    np.array([model.predict_one({x: float(x == z) for x in "abcd"}) for z in "abcd"]),
                )


def padasip_99(y: np.ndarray, u: np.ndarray) -> Steps:
    return padasip_steps(y, u, 0.99)


def filterpy_walk(y: np.ndarray, u: np.ndarray) -> Steps:
    # the quickest of 1e-4 to 1 whose steady error is not above that of padasip by half
    return filterpy_steps(y, u, 1e-3)


def river_998(y: np.ndarray, u: np.ndarray) -> Steps:
    return river_steps(y, u, 0.998)


TRACKING = (
    Peer("padasip RLS-ARX, forgetting 0.99", padasip_99, "padasip"),
    Peer("filterpy KalmanFilter-ARX, random walk", filterpy_walk, "filterpy"),
    Peer("river BayesianLinearRegression-ARX, smoothing 0.998", river_998, "river"),
)
