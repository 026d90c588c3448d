"""An offset that drifts as a random walk while gains may step: slow cosines with the variances of a Wiener process.

A push of the driver's own that lasts for half a minute is answered by the loop, and the noise model, with a second's memory,
takes it for a change of the answer. With the level in the null as well as in the step (a local level; Harvey 1989, ch. 2)
it is neither. The walk's variance is the likeliest without a step; mostly it is zero, and nothing changes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.fopdt.answer_columns import Columns
from canid.mathematics.identification.fopdt.offset_drift import SCALES, cosines, count, variances
from canid.values.types import Array


class Level(NamedTuple):
    """Inner products of each block of rows with the cosines."""

    with_columns: Array  # (b, c, l)
    with_each_other: Array  # (b, l, l)
    variance: Array  # (l,) of each cosine's coefficient, in shares of a walk's


def grams(columns: Columns, white: Array, block: int) -> Level:
    """Inner products of blocks of rows, the last block complete.

    Args:
        columns: weighed, (c, n).
        white: (l, n) cosines, whitened as the columns.
        block: rows.
    """
    n = columns.values.shape[1]
    lacking = -n % block

    def blocks(x: Array) -> Array:
        padded = np.concatenate([np.zeros((len(x), lacking)), x], axis=1)
        # a short drive has no cosine
        return padded.reshape(len(x), (n + lacking) // block, block).transpose(1, 0, 2)

    weighted = blocks(white * columns.weight).transpose(0, 2, 1)
    return Level(blocks(columns.values) @ weighted, blocks(white) @ weighted, variances(len(white)))


def raw(rows: int, step: float) -> Array:
    """(l, n) the cosines, not whitened."""
    return cosines(count(rows, step), rows)


def likeliest(parts: Array, level: Level, precision: Array) -> Array | None:
    """Variances (l,) of the cosines' coefficients at the likeliest walk without a step; None: no walk is.

    Args:
        parts: (b, c, c) inner products of the columns, the output the last.
        level: of the same blocks.
        precision: (c - 1,) of the prior of each column's coefficient.
    """
    total, cross, of_cosines = (
        parts.sum(axis=0),
        level.with_columns.sum(axis=0),
        level.with_each_other.sum(axis=0),
    )
    q = len(precision)
    M = total[:q, :q] + np.diag(precision + 1e-9 * np.diag(total)[:q] + 1e-12)
    by = np.linalg.solve(M, np.column_stack([cross[:q], total[:q, -1]]))
    left = of_cosines - cross[:q].T @ by[:, :-1]
    along = cross[-1] - cross[:q].T @ by[:, -1]
    root = np.sqrt(level.variance)
    scaled, on = root[:, None] * left * root, root * along
    size = float(np.trace(scaled))
    if not size > 0.0:
        return None
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    values, on = np.maximum(values, 0.0), vectors.T @ on
    tried = SCALES[:, None] / size
    more = 1.0 + tried * values
    log_likelihood = 0.5 * (tried * on**2 / more - np.log(more)).sum(axis=1)
    best = int(np.argmax(log_likelihood))
    return None if best == 0 else float(tried[best, 0]) * level.variance


def without(
    M: Array, r: Array, cross: Array, of_cosines: Array, along: Array, variance: Array
) -> tuple[Array, Array]:
    """Normal equations with the level integrated out (Schur complement).

    Args:
        M: (k, p, p) of the columns.
        r: (k, p) with the output.
        cross: (k, p, l) of the columns with the cosines.
        of_cosines: (l, l) of the cosines.
        along: (l,) of the cosines with the output.
        variance: (l,) of their coefficients.
    """
    root = np.sqrt(variance)
    S = np.eye(len(root)) + root[:, None] * of_cosines * root
    half = np.linalg.cholesky(S)
    B = np.linalg.solve(half, (cross * root).transpose(0, 2, 1))  # (k, l, p)
    y = np.linalg.solve(half, root * along)
    return M - B.transpose(0, 2, 1) @ B, r - np.einsum("klp,l->kp", B, y)
