"""An offset that drifts: slow cosines, as many as the likelihood asks for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.identification import autoregression
from canid.types import Array

Flags = npt.NDArray[np.bool_]

# A headway that is wanted longer and longer, or now longer and now shorter, moves the offset; a noise model of a second's
# memory takes that for an answer to the headway, whose gain it halves. Cosines no shorter than this in period follow it
# (half of them is what a driver's own answer still moves).
SHORTEST_DRIFT_S = 40.0
# numbers of cosines that are tried
DRIFTS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
# What a cosine must add to the log likelihood, and the first of them once more: on a drive without drift one is added in
# about one of 200.
DRIFT_LEAST, DRIFT_FIRST = 1.0, 4.0


def find(residual: Array, usable: Flags, step: float, stride: int, order: int) -> Array:
    """Return (k, n) the cosines that the offset follows: none, unless the likelihood asks for them.

    Args:
        residual: (n,), zero where not usable.
        usable: (n,).
        step: s, of the rows.
        stride: rows.
        order: highest of the noise's autoregression.
    """
    n = len(residual)
    most = int(2.0 * n * step / SHORTEST_DRIFT_S)
    part = usable[::stride]
    run = autoregression.run_lengths(part)
    rows = part & (run >= order)
    free = np.where(usable, residual, 0.0)
    every = np.vstack([np.ones(n), cosines(min(most, max(DRIFTS)), n)])
    gram, along = _products(every, free, usable)
    best, chosen = -np.inf, 0
    for k in (k for k in DRIFTS if k <= most):
        r = (
            _left(every[: k + 1], gram[: k + 1, : k + 1], along[: k + 1], free)[::stride]
            if k
            else free[::stride]
        )
        ar = autoregression.fit(r, part, order, run=run)
        e = autoregression.whiten(r, ar)[rows]
        count = len(e) - k
        if count < 10 * (k + 1) or not e.any():
            break
        value = -0.5 * count * float(np.log(float(e @ e) / count)) - DRIFT_LEAST * k - DRIFT_FIRST * (k > 0)
        if value > best:
            best, chosen = value, k
    return every[1 : chosen + 1]


def cosines(k: int, n: int) -> Array:
    """(k, n) cosines of half a period in n rows, one, one and a half, ...

    >>> cosines(1, 2).round(3)
    array([[ 0.707, -0.707]])
    """
    out: Array = np.cos(np.pi * np.outer(np.arange(1, k + 1), (np.arange(n) + 0.5) / n))
    return out


def without(columns: Array, r: Array, usable: Flags) -> Array:
    """Take columns (k, n) and a mean out of a residual (n,), by what they explain of it where usable."""
    if not len(columns):
        return r
    every = np.vstack([np.ones(len(r)), columns])
    return _left(every, *_products(every, r, usable), r)


def _products(every: Array, r: Array, usable: Flags) -> tuple[Array, Array]:
    """Inner products of columns (k, n) with each other and with a residual (n,), where usable."""
    used = every * usable
    gram: Array = used @ every.T
    gram.flat[:: len(gram) + 1] *= 1.0 + 1e-9
    return gram, used @ r


def _left(every: Array, gram: Array, along: Array, r: Array) -> Array:
    """Return what columns leave of a residual; zero where it was."""
    out: Array = r - np.linalg.solve(gram, along) @ every
    out[r == 0.0] = 0.0
    return out
