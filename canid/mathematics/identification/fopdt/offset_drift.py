"""An offset that drifts as a random walk: slow cosines with the variances of a Wiener process; mostly it does not.

Without it a wanted headway that drifts takes half of K1. The cosines' coefficients are random, not free: free ones take
whatever a slow noise has in their band, the loop's answer to it included, and the gain that is left is another one (of 28
simulated drives whose noise has steps or drifts it was held in 20). With the walk's variance a level is one more part of the
noise (a local level; Harvey 1989, ch. 2), and the likelihood of a variance, the coefficients integrated out, says whether
there is one.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import autoregression
from canid.values.types import Array

Flags = npt.NDArray[np.bool_]

# A headway that is wanted longer and longer, or now longer and now shorter, moves the offset; a noise model of a second's
# memory takes that for an answer to the headway, whose gain it halves. Cosines no shorter than this in period follow it
# (half of them is what a driver's own answer still moves).
SHORTEST_DRIFT_S = 40.0
# cosines at most: an hour's inner products take 100 MB
MOST_COSINES = 96
# Of the level that is lost in the noise, variances that are tried: from a hundredth of it on
SCALES = np.concatenate([[0.0], np.geomspace(1e-2, 1e6, 33)])
# Log likelihood that a drift must add: on a drive without one it is found in about one of 200.
LEAST_EVIDENCE = 4.0
# rounds of noise model and walk, each estimated with the other
ROUNDS = 3


class Drift(NamedTuple):
    """A walk of the offset, and the noise model that it was found with."""

    walk: float  # variance over the drive, in variances of an innovation; 0: the offset stays
    columns: (
        Array  # (k, n) cosines, each with a coefficient of an innovation's variance; none: the offset stays
    )
    ar: Array  # (p,) autoregression of every `stride`-th row


def count(rows: int, step: float) -> int:
    """How many cosines are no shorter than what a driver's answer leaves alone.

    Args:
        rows: of the drive.
        step: s, of the rows.
    """
    return min(int(2.0 * rows * step / SHORTEST_DRIFT_S), MOST_COSINES)


def find(residual: Array, usable: Flags, step: float, stride: int, order: int) -> Drift:
    """Return the likeliest walk of the offset: none, unless the likelihood asks for it.

    Args:
        residual: (n,), zero where not usable.
        usable: (n,).
        step: s, of the rows.
        stride: rows.
        order: highest of the noise's autoregression.
    """
    n = len(residual)
    k = count(n, step)
    stays = Drift(0.0, np.zeros((0, n)), np.zeros(0))
    part = usable[::stride]
    run = autoregression.run_lengths(part)
    # as many innovations for each cosine as each coefficient of the noise model has
    if k < 1 or np.count_nonzero(part & (run >= order)) < 10 * (k + 1):
        return stays
    free = np.where(usable, residual, 0.0)
    unit = _walks(k, n)
    every = np.vstack([np.ones(n), unit])
    rows = _rows(usable, stride, order)
    steady = autoregression.fit(free[::stride], part, order, run=run)
    least = _tried(_gram(every, free, rows, steady, stride), rows, stride)[1][0] - len(steady)
    # from the noise that is left by as much drift as there may be: one that holds the drift would find none
    used = every * usable
    gram = used @ every.T
    gram.flat[:: k + 2] *= 1.0 + 1e-9
    left = np.where(usable, free - np.linalg.solve(gram, used @ free) @ every, 0.0)
    walk, ar, value = 0.0, steady, -np.inf
    for _ in range(ROUNDS):
        ar = autoregression.fit(left[::stride], part, order, run=run)
        tried, values = _tried(_gram(every, free, rows, ar, stride), rows, stride)
        best = int(np.argmax(values))
        walk, value = float(tried[best]), float(values[best]) - len(ar)
        if walk == 0.0:
            return stays
        left = without(walk**0.5 * unit, free, usable, ar, stride)[0]
    return Drift(walk, walk**0.5 * unit, ar) if value > least + LEAST_EVIDENCE else stays


def cosines(k: int, n: int) -> Array:
    """(k, n) cosines of half a period in n rows, one, one and a half, ...

    >>> cosines(1, 2).round(3)
    array([[ 0.707, -0.707]])
    """
    out: Array = np.cos(np.pi * np.outer(np.arange(1, k + 1), (np.arange(n) + 0.5) / n))
    return out


def variances(k: int) -> Array:
    """(k,) of the coefficients of the first cosines in a Wiener process whose variance at the end is one.

    >>> variances(2).round(3)
    array([0.203, 0.051])
    """
    return np.asarray(2.0 / (np.pi * np.arange(1, k + 1)) ** 2, float)


@lru_cache(maxsize=1)
def _walks(k: int, n: int) -> Array:
    """(k, n) cosines as large as in a walk; kept, as every start of a drive's search asks for the same."""
    out: Array = np.sqrt(variances(k))[:, None] * cosines(k, n)
    out.setflags(write=False)
    return out


def without(columns: Array, r: Array, usable: Flags, ar: Array, stride: int) -> tuple[Array, float]:
    """Take a mean and a drift out of a residual (n,), by the expectation of its coefficients.

    Args:
        columns: (k, n) as of a `Drift`; none: nothing is taken out.
        r: (n,); zero where it is not known, and left so.
        usable: (n,) rows that the coefficients are estimated from.
        ar: (p,) autoregression of every `stride`-th row.
        stride: rows.

    Returns:
        What is left, and what the drift costs in log likelihood: its coefficients' own, and that they are integrated out.
    """
    if not len(columns):
        return r, 0.0
    every = np.vstack([np.ones(len(r)), columns])
    rows = _rows(usable, stride, len(ar))
    gram = _gram(every, np.where(usable, r, 0.0), rows, ar, stride)
    M, along = gram[:-1, :-1].copy(), gram[:-1, -1]
    cosines = M[1:, 1:] - np.outer(M[1:, 0], M[0, 1:]) / max(M[0, 0], 1e-300)
    M.flat[:: len(M) + 1] += np.r_[1e-300, np.ones(len(columns))]
    coefficients = np.linalg.solve(M, along)
    out: Array = r - coefficients @ every
    out[r == 0.0] = 0.0
    variance = float(gram[-1, -1] - coefficients @ along) * stride / max(float(np.count_nonzero(rows)), 1.0)
    surprise = float(coefficients[1:] @ coefficients[1:]) / max(variance, 1e-300)
    return out, 0.5 * (surprise + float(np.linalg.slogdet(np.eye(len(cosines)) + cosines)[1]))


def of_fit(walk: float, r: Array, usable: Flags, ar: Array, stride: int, step: float) -> Array:
    """Take the drift of a fit out of a residual (n,) of its drive; a walk of 0 takes nothing out.

    Args:
        walk: of the fit.
        r: (n,) zero where it is not known.
        usable: (n,).
        ar: (p,) the fit's noise model.
        stride: rows, of it.
        step: s, of the rows.
    """
    if not walk > 0.0:
        return r
    return without(walk**0.5 * _walks(count(len(r), step), len(r)), r, usable, ar, stride)[0]


def _rows(usable: Flags, stride: int, order: int) -> Flags:
    """(n,) rows whose predecessors, one in `stride` rows, are usable."""
    out: Flags = usable & (autoregression.run_lengths(usable) >= order * stride)
    return out


def _gram(every: Array, r: Array, rows: Flags, ar: Array, stride: int) -> Array:
    """Inner products of columns (k, n) and a residual (n,), whitened, as of one phase of the stride."""
    white = autoregression.whiten(np.vstack([every, r]), ar, stride)[:, autoregression.chosen(rows)]
    out: Array = white @ white.T / stride
    return out


def _tried(gram: Array, rows: Flags, stride: int) -> tuple[Array, Array]:
    """Variances of a walk, zero first, and the log likelihood of each: coefficients and innovations' size are taken out."""
    left = gram[1:, 1:] - np.outer(gram[1:, 0], gram[0, 1:]) / max(gram[0, 0], 1e-300)
    values, vectors = np.linalg.eigh(left[:-1, :-1])
    values, on = np.maximum(values, 0.0), vectors.T @ left[:-1, -1]
    tried = SCALES / max(float(values.sum()), 1e-300)
    more = 1.0 + tried[:, None] * values
    squares = left[-1, -1] - (tried[:, None] * on**2 / more).sum(axis=1)
    counted = np.count_nonzero(rows) / stride
    return tried, -0.5 * (counted * np.log(np.maximum(squares, 1e-300)) + np.log(more).sum(axis=1))
