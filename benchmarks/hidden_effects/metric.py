"""Mahalanobis distance between two pedal signals under the driver's noise: whitened, and weighted by the noise scale.

The likelihood ratio of two means under Gaussian noise of covariance S is d' S^-1 d on the samples that are seen. With an
autoregression, S^-1 is a band: W'W, W the whitening. Samples that nobody sees are filled in with their conditional mean,
which is the same as leaving their rows and columns out of S (the Schur complement), and takes one banded solution.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import nnls
from scipy.sparse import csr_array, diags_array

from tests.plants.planted_drive import Array

# Highest order of the noise model, 3 s at 10 Hz: the resonant noise's period is 4 s, and its damping leaves a
# tenth after 3 s. Akaike's criterion takes what it needs of it: 30 coefficients for what two can hold would spread the
# price of a drive of ten minutes by 15 % instead of 10 %.
MAX_AR_ORDER = 30
# (n,) or (n, k) pedals in % -> (m,) or (m, k), whose squares sum up to likelihood ratios
Metric = Callable[[Array], Array]


def size(remnant: Array, answer: Array, floor: float) -> Array:
    """Sd (n,) of noise that grows with the answer: its square is c0 + c1 |answer| + c2 answer² + floor², c >= 0.

    Args:
        remnant: (n,) %.
        answer: (n,) %: the driver's answer without the offset.
        floor: % sd of what is added to it, whatever the answer.
    """
    a = np.abs(answer)
    shapes = np.column_stack([np.ones(len(a)), a, a * a])
    variance = np.full(len(a), float(np.mean(remnant**2)) + 1e-12)
    # the spread of a square goes with the square's mean; three rounds settle the weights within a per cent
    for _ in range(3):
        found, _ = nnls(shapes / variance[:, None], remnant**2 / variance)
        variance = np.maximum(shapes @ found, 1e-3 * float(np.mean(remnant**2)) + 1e-12)
    out: Array = np.sqrt(variance + floor**2)
    return out


def metric(remnant: Array, white: float, scale: Array, seen: npt.NDArray[np.bool_]) -> Metric:
    """Fit an autoregression to the noise that was there, and make its metric.

    Args:
        remnant: (n,) %.
        white: % sd of what the measurement adds.
        scale: (n,) sd that the noise had at each sample, up to a factor.
        seen: (n,) samples that are seen; the others' values are ignored.

    Returns:
        The metric.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> far = metric(2.0 * rng.normal(size=5000), 0.0, np.ones(5000), np.arange(5000) % 100 < 50)
        >>> bool(abs(np.sum(far(np.ones(5000)) ** 2) / (2500 / 4.0) - 1.0) < 0.15)
        True
    """
    n = len(remnant)
    z = remnant / scale
    r = np.array([z[: n - i] @ z[i:] for i in range(MAX_AR_ORDER + 1)]) / n
    r[0] += white**2 * float(np.mean(1.0 / scale**2))
    taps = _whitening(r, n)
    order = len(taps) - 1
    filtering = diags_array(taps[::-1], offsets=np.arange(order + 1), shape=(n - order, n))
    W = csr_array(filtering @ diags_array(1.0 / scale))
    hidden = np.flatnonzero(~seen)
    if not len(hidden):
        return lambda x: np.asarray(W @ x)
    H = csr_array(W[:, hidden])
    factor = cholesky_banded(_band(csr_array(H.T @ H), order), lower=True)
    blind = np.where(seen, 1.0, 0.0)

    def whitened(x: Array) -> Array:
        y = np.asarray(W @ (x * (blind if x.ndim == 1 else blind[:, None])))
        filled = cho_solve_banded((factor, True), np.asarray(H.T @ y))
        out: Array = y - np.asarray(H @ filled)
        return out

    return whitened


def _whitening(r: Array, n: int) -> Array:
    """Filter (order + 1,) that turns noise of the autocovariances r into white noise of variance 1.

    Levinson's and Durbin's recursion gives every order; Akaike's criterion chooses.
    """
    phi, left = np.zeros(0), float(r[0])
    best, taps = n * np.log(left), np.ones(1) / np.sqrt(left)
    for order in range(1, len(r)):
        reflection = (r[order] - phi @ r[order - 1 : 0 : -1]) / left
        phi = np.concatenate([phi - reflection * phi[::-1], [reflection]])
        left *= 1.0 - reflection**2
        criterion = n * np.log(left) + 2.0 * order
        if criterion < best:
            best, taps = criterion, np.concatenate([[1.0], -phi]) / np.sqrt(left)
    return taps


def _band(P: csr_array, order: int) -> Array:
    """Lower band of a symmetric matrix, as scipy.linalg wants it."""
    entries = P.tocoo()
    row, column = entries.coords
    below = row >= column
    out = np.zeros((order + 1, P.shape[0]))
    out[(row - column)[below], column[below]] = entries.data[below]
    # an unseen sample at the drive's very begin may stand in no whitened row: any value will do for it
    out[0] += 1e-9 * max(float(out[0].max()), 1e-12)
    return out
