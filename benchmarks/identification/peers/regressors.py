"""Lagged columns, and least squares on them: what every toolbox's ARX is."""

from __future__ import annotations

import numpy as np


def lagged(x: np.ndarray, lags: range) -> np.ndarray:
    """Return (n, lags) columns x[k - lag]; the first rows, without real lags, are zero.

    >>> lagged(np.array([1.0, 2.0, 3.0]), range(1, 3))
    array([[0., 0.],
           [1., 0.],
           [2., 1.]])
    """
    out = np.zeros((len(x), len(lags)))
    for i, lag in enumerate(lags):
        out[lag:, i] = x[: len(x) - lag]
    return out


def arx(
    y: np.ndarray, inputs: list[np.ndarray], na: int, nb: int, nk: list[int], first: int
) -> tuple[np.ndarray, float]:
    """Fit A y = sum B_i u_i + c by least squares on the rows from `first`.

    Returns:
        a1..., b_1,1..., b_2,1..., c; and the sum of squares.
    """
    X = np.column_stack(
        [
            -lagged(y, range(1, na + 1)),
            *(lagged(u, range(k, k + nb)) for u, k in zip(inputs, nk, strict=True)),
            np.ones(len(y)),
        ]
    )[first:]
    theta = np.linalg.lstsq(X, y[first:], rcond=None)[0]
    error = y[first:] - X @ theta
    return theta, float(error @ error)
