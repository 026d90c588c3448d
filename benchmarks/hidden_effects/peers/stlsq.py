"""PySINDy's STLSQ on the library: sequentially thresholded least squares (Brunton, Proctor & Kutz, PNAS 2016)."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np

from tests.plants.planted_drive import Array


class Settings(NamedTuple):
    """What its user has to choose."""

    threshold: float  # of a coefficient, target and columns of variance 1
    alpha: float  # ridge
    memory: int  # samples of the past in addition to the columns


def select(X: Array, y: Array, threshold: float, alpha: float) -> list[tuple[int, float]]:
    """Fit; returns the columns that are kept, and the size of their coefficients."""
    from pysindy import STLSQ

    if not X.shape[1]:
        return []
    with warnings.catch_warnings():
        # it warns where it keeps nothing, which is an answer
        warnings.simplefilter("ignore")
        fit = STLSQ(threshold=threshold, alpha=alpha).fit(X, y)
    coefficients = np.ravel(fit.coef_)
    return [(int(k), float(abs(coefficients[k]))) for k in np.flatnonzero(coefficients)]
