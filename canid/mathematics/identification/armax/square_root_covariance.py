"""A covariance as P = S S', updated by Potter's square root: no rounding makes it indefinite, not even float32's.

Several covariances are stacked and updated at once. Forgetting is a step of its own, every block of samples
and only in the directions that the block has renewed (Cao & Schwartz 2000, "A directional forgetting
algorithm based on the decomposition of the information matrix"), so that twenty minutes without excitation
neither erase what was known nor let the covariance grow.

The UD form saves the square roots; in Python it was four times slower.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.types import Array

# A block takes away at most this many times the information that it brings, in each direction: a direction
# whose excitation falls to a sixth is still forgotten at full pace (traffic comes in waves of 10 to 30 s),
# and one in which inputs only tremble loses next to nothing however long that lasts.
RENEWAL = 6.0


class Update(NamedTuple):
    """What a sample did."""

    root: Array  # (k, n, n)
    gain: Array  # (k, 1, n), P psi / (1 + r)
    spread: Array  # (k, 1, 1), 1 + r: variance of the prediction error over that of the noise


def factor(P: Array) -> Array:
    """Return S with P = S S'.

    Raises:
        ValueError: P is not positive definite.

    >>> S = factor(np.array([[2.0, 0.5], [0.5, 1.0]]))
    >>> S @ S.T
    array([[2. , 0.5],
           [0.5, 1. ]])
    """
    try:
        S = np.asarray(np.linalg.cholesky(P), float)
    except np.linalg.LinAlgError:
        raise ValueError("P is not positive definite: add a little to its diagonal") from None
    return S


def update(root: Array, psi: Array) -> Update:
    """Take in one sample per covariance, noise variance one: P+ = P - P psi psi' P / (1 + r), r = psi' P psi.

    Potter's formula (Battin 1964; Bierman 1977, sec. II.6) with f = S' psi:
    S+ = S - S f f' / (s (1 + s)), s = sqrt(1 + f'f). Nothing is divided by what may be zero.

    Args:
        root: (k, n, n).
        psi: (k, 1, n).

    >>> done = update(np.eye(2)[None], np.array([[[1.0, 0.0]]]))
    >>> np.round(done.root[0] @ done.root[0].T, 12), done.gain[0]
    (array([[0.5, 0. ],
           [0. , 1. ]]), array([[0.5, 0. ]]))
    """
    f = psi @ root
    column = f.swapaxes(1, 2)
    spread = f @ column + 1.0
    g = root @ column
    # an outer product as matmul: one rounding each, as a broadcast makes, in less time
    return Update(root - g @ (f / (spread + np.sqrt(spread))), g.swapaxes(1, 2) / spread, spread)


def forget(root: Array, regressors: Array, forgetting: Array) -> Array:
    """Let a block of samples, already taken in, displace what it has renewed.

    Along each eigenvector of S' (sum psi psi') S the eigenvalue is the share of the present information that
    the block brought. There the old loses the factor forgetting^count, as in exponential forgetting, but
    never more than RENEWAL times what came.

    Args:
        root: (k, n, n), after the block.
        regressors: (k, count, n), the block.
        forgetting: (k,) per sample, in (0, 1].

    >>> still = forget(np.eye(2)[None], np.array([[[0.9, 0.0]]]), np.array([0.5]))
    >>> np.round(still[0] @ still[0].T, 12)
    array([[2., 0.],
           [0., 1.]])
    """
    X = regressors @ root
    share, V = np.linalg.eigh(X.swapaxes(1, 2) @ X)
    most = 1.0 - forgetting[:, None] ** regressors.shape[1]
    # rounding may leave a share a little below zero
    lost = np.minimum(most, RENEWAL * np.maximum(share, 0.0))
    forgotten: Array = (root @ V) / np.sqrt(1.0 - lost)[:, None, :]
    return forgotten
