"""How much a cause explains, and how much of that a coloured or uneven noise would explain by chance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.stats import chi2

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.driver_model import K1, K2, OFFSET
from canid.diagnosis.least_squares import Fitted
from canid.diagnosis.solved import Solved, solve
from canid.types import Array

# of a direction's own size; keeps the inverse of two that coincide finite
RIDGE = 1e-6
# s; what is left of the noise's colour after whitening, and what its size does, has died away by then
REACH = 5.0
# chance that any candidate is named on a drive without causes, all of them together: half of what is promised, as
# evidence is trusted to follow its law only so far
FAMILY = 0.005
# chance that an output that answers nothing is taken for one that does
SILENT = 1e-4


def needed(parameters: int, tried: int) -> float:
    """Evidence that chance exceeds once in FAMILY drives, with so many candidates (Bonferroni).

    Example:
        >>> round(needed(1, 20), 1)
        13.4
    """
    return float(chi2.isf(FAMILY / max(tried, 1), max(parameters, 1)))


def answered(data: DriverData, fitted: Solved) -> bool:
    """Does the output answer headway or relative speed at all, by more than chance?

    Without an answer there is nothing that a cause could change.
    """
    q = fitted.q.copy()
    q[[K1, K2]] = 0.0
    silent = solve(data, (), q, fitted.noise, fitted.rows, free=(OFFSET,))
    freed = len(fitted.fitted.free) - 1
    return silent.deviance - fitted.deviance > float(chi2.isf(SILENT, freed))


def inflation(solved: Solved, of: list[int], dt: float) -> float:
    """How much larger the score of some parameters spreads than the likelihood says: at least 1.

    The likelihood believes that whitened residuals are white and of even size. The score's real spread is that of
    its sums over `REACH` (Newey & West 1987); their ratio is by how much evidence is overstated (White 1982).

    Args:
        solved: a model.
        of: indices into q.
        dt: s.
    """
    J, e = solved.fitted.jacobian, solved.fitted.scored.e
    columns = [solved.fitted.free.index(k) for k in of]
    others = [k for k in range(J.shape[1]) if k not in columns]
    G = J[:, columns]
    if others:
        Q = qr(J[:, others], mode="economic")[0]
        G = G - Q @ (Q.T @ G)
    bread = G.T @ G
    if not np.all(np.diag(bread) > 1e-9 * np.maximum(np.sum(J[:, columns] ** 2, axis=0), 1e-300)):
        return 1.0
    meat = spread(G * e[:, None], round(REACH / dt))
    # to unit length, and no direction narrower than rounding: two parameters that do the same here are one
    scale = np.sqrt(np.outer(np.diag(bread), np.diag(bread)))
    ratio = np.linalg.eigvals(np.linalg.solve(bread / scale + RIDGE * np.eye(len(bread)), meat / scale)).real
    return max(float(ratio.max()), 1.0)


class Spread(NamedTuple):
    """How the free parameters of a fit spread."""

    C: Array  # (k, k) covariance
    overstated: Array  # (k,) robust variance over the likelihood's, at least 1


def sandwich(fitted: Fitted, dt: float) -> Spread:
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
    robust = plain @ (spread(J * e[:, None], round(REACH / dt)) + ties.T @ ties) @ plain
    overstated = np.maximum(np.diag(robust) / np.diag(plain), 1.0)
    wider = np.sqrt(overstated) / scale
    return Spread(plain * wider[:, None] * wider[None, :], overstated)


def spread(g: Array, reach: int) -> Array:
    """Sum of the autocovariances of g (n, k) up to a reach, tapered (Newey & West 1987): (k, k)."""
    total: Array = g.T @ g
    for lag in range(1, reach + 1):
        cross = g[lag:].T @ g[:-lag]
        total = total + (1 - lag / (reach + 1)) * (cross + cross.T)
    return total
