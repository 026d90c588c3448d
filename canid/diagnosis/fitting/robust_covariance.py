"""Robust covariance of a fit and its scores (White 1982; Newey & West 1987), and the evidence that chance exceeds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.stats import chi2

from canid.diagnosis.fitting.least_squares import Fitted
from canid.types import Array

# of a direction's own size; keeps the inverse of two that coincide finite
RIDGE = 1e-6
# s; the autocorrelation that whitening leaves, and that of the noise scale, has died away by then
SCORE_LAG_S = 5.0
# chance that any candidate is named on a drive without causes, all of them together: half of what is promised, as
# evidence is trusted to follow its law only so far
FALSE_ALARM = 0.005


def needed(parameters: int, tried: int) -> float:
    """Evidence that chance exceeds once in FALSE_ALARM drives, with so many candidates (Bonferroni).

    Example:
        >>> round(needed(1, 20), 1)
        13.4
    """
    return float(chi2.isf(FALSE_ALARM / max(tried, 1), max(parameters, 1)))


def inflation(fitted: Fitted, of: Sequence[int], dt: float) -> float:
    """Variance inflation of the score of some parameters over the likelihood's: at least 1.

    The likelihood believes that whitened residuals are white and of even size. The score's real spread is that of
    its sums over `SCORE_LAG_S` (Newey & West 1987); their ratio is by how much evidence is overstated (White 1982).

    Args:
        fitted: with whitened residuals and their derivatives.
        of: indices into q.
        dt: s.
    """
    J, e = fitted.jacobian, fitted.scored.e
    columns = [fitted.free.index(k) for k in of]
    others = [k for k in range(J.shape[1]) if k not in columns]
    G = J[:, columns]
    if others:
        Q = qr(J[:, others], mode="economic")[0]
        G = G - Q @ (Q.T @ G)
    bread = G.T @ G
    if not np.all(np.diag(bread) > 1e-9 * np.maximum(np.sum(J[:, columns] ** 2, axis=0), 1e-300)):
        return 1.0
    meat = newey_west(G * e[:, None], round(SCORE_LAG_S / dt))
    # to unit length, and no direction narrower than rounding: two parameters that do the same here are one
    scale = np.sqrt(np.outer(np.diag(bread), np.diag(bread)))
    ratio = np.linalg.eigvals(np.linalg.solve(bread / scale + RIDGE * np.eye(len(bread)), meat / scale)).real
    return max(float(ratio.max()), 1.0)


class Covariance(NamedTuple):
    """Covariance of the free parameters of a fit."""

    C: Array  # (k, k) covariance
    variance_inflation: Array  # (k,) robust variance over the likelihood's, at least 1


def sandwich(fitted: Fitted, dt: float) -> Covariance:
    """Covariance of the free parameters (White 1982), nowhere narrower than the likelihood's.

    Args:
        fitted: with whitened residuals (n,), their derivatives (n, k) and what was known beforehand.
        dt: s.
    """
    J, e = fitted.jacobian, fitted.scored.e
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0] = 1.0
    J, ties = J / scale, fitted.ties / scale
    # a direction that the data do not know is wide, not singular
    plain = np.linalg.inv(J.T @ J + ties.T @ ties + 1e-8 * np.eye(J.shape[1]))
    robust = plain @ (newey_west(J * e[:, None], round(SCORE_LAG_S / dt)) + ties.T @ ties) @ plain
    variance_inflation = np.maximum(np.diag(robust) / np.diag(plain), 1.0)
    wider = np.sqrt(variance_inflation) / scale
    return Covariance(plain * wider[:, None] * wider[None, :], variance_inflation)


def newey_west(g: Array, lags: int) -> Array:
    """Sum of the autocovariances of g (n, k) up to some lags, tapered (Newey & West 1987): (k, k)."""
    total: Array = g.T @ g
    for lag in range(1, lags + 1):
        cross = g[lag:].T @ g[:-lag]
        total = total + (1 - lag / (lags + 1)) * (cross + cross.T)
    return total
