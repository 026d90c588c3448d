"""A step of the gains at an unknown time: Bayes factors over the possible times, and the gains before and after.

Model: the output's whitened rows are a regression on answers, offset and slopes (answer_columns.py); from the time c on,
gains and offset are others. The Bayes factor of c against a driver whose offset alone changed there is the
Savage-Dickey ratio: density of "no change of gain" before the data over that after them (Dickey 1971). The sum over all
c is the Shiryaev-Roberts statistic (Shiryaev 1963, Roberts 1966): its mean grows by one a candidate while nothing
changes, so a threshold of A is exceeded once in A candidates at most (Pollak 1985), and among the candidates of a drive
with probability (their number) / A at most (Markov).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import QUANTILES
from canid.mathematics.identification.fopdt import drifting_level, weighted_quantiles
from canid.mathematics.identification.fopdt.answer_columns import Columns
from canid.mathematics.identification.fopdt.drifting_level import Level
from canid.values.types import Array, Interval

# Prior of a change of gain: relative sd, and correlation between the channels. Drivers and regimes differ by such
# amounts (Grover 2021: K2 4.4 to 8.0); a driver who follows closer answers to both inputs more.
CHANGE_SD = 0.4
CHANGE_CORRELATION = 0.75
# s between two times at which a gain may have changed
CANDIDATE_S = 1.0


class Steps(NamedTuple):
    """What the data say of a step at each candidate time."""

    rows: Array  # (k,) the first row after the step
    log_bayes: Array  # (k,) log Bayes factor of a step of gains against none
    before: Array  # (k, m) gains
    before_sd: Array  # (k, m)
    after: Array  # (k, m)
    after_sd: Array  # (k, m)

    @property
    def evidence(self) -> float:
        """Log of the Shiryaev-Roberts statistic; -inf without a candidate."""
        return float(np.logaddexp.reduce(self.log_bayes)) if len(self.log_bayes) else -np.inf

    @property
    def best(self) -> int:
        """Return the index of the most likely time."""
        return int(np.argmax(self.log_bayes))


def grams(columns: Columns, block: int) -> Array:
    """Inner products (b, c, c) of blocks of rows, the last block complete."""
    c, n = columns.values.shape
    lacking = -n % block
    values = np.concatenate([np.zeros((c, lacking)), columns.values], axis=1).reshape(c, -1, block)
    weight = np.concatenate([np.zeros(lacking), columns.weight]).reshape(-1, block)
    left = (values * weight).transpose(1, 0, 2)
    out: Array = left @ values.transpose(1, 2, 0)
    return out


def steps(columns: Columns, size: Array, block: int, earlier: Array | float = 0.0) -> Steps:
    """Test a step before each block of rows.

    Args:
        columns: weighed, (c, n).
        size: (m,) of the gains.
        block: rows between two candidates.
        earlier: (c, c) inner products of rows before all of them.
    """
    n = columns.values.shape[1]
    parts = grams(columns, block)
    return of_grams(parts, columns, size, np.arange(len(parts)) * float(block) - (-n % block), earlier)


def of_grams(
    parts: Array,
    columns: Columns,
    size: Array,
    rows: Array,
    earlier: Array | float = 0.0,
    change_sd: float = CHANGE_SD,
    level: Level | None = None,
) -> Steps:
    """Test a step before each block but the first, from the blocks' inner products.

    Args:
        parts: (b, c, c).
        columns: names the columns.
        size: (m,) of the gains.
        rows: (b,) the first row of each block.
        earlier: (c, c) inner products of rows before all of them.
        change_sd: relative sd of a change before the data.
        level: of the same blocks, an offset that may drift with a step or without; None: it stays but for the step.
    """
    m = columns.inputs
    q = len(columns.precision)
    stepping = m + 1  # what steps: gains and offset
    total = parts.sum(axis=0) + earlier
    after = np.cumsum(parts[::-1], axis=0)[::-1][1:]
    k = len(after)
    M, r = np.zeros((k, q + stepping, q + stepping)), np.zeros((k, q + stepping))
    M[:, :q, :q], r[:, :q] = total[:q, :q], total[:q, -1]
    M[:, :q, q:] = after[:, :q, :stepping]
    M[:, q:, :q] = after[:, :stepping, :q]
    M[:, q:, q:], r[:, q:] = after[:, :stepping, :stepping], after[:, :stepping, -1]
    drifts = None if level is None else drifting_level.likeliest(parts, level, columns.precision)
    if level is not None and drifts is not None:
        cross = level.with_columns.sum(axis=0)
        behind = np.cumsum(level.with_columns[::-1, :stepping], axis=0)[::-1][1:]
        both = np.concatenate([np.broadcast_to(cross[:q], (k, *cross[:q].shape)), behind], axis=1)
        M, r = drifting_level.without(M, r, both, level.with_each_other.sum(axis=0), cross[-1], drifts)
    prior = change_prior(size, change_sd)
    # offsets and gains have no prior but a trace that keeps the matrix regular
    trace = 1e-9 * np.diag(total)[:q] + 1e-12
    M[:, np.arange(q), np.arange(q)] += columns.precision + trace
    M[:, q : q + m, q : q + m] += np.linalg.inv(prior)
    M[:, -1, -1] += 1e-9 * total[m, m] + 1e-12
    C = np.linalg.inv(M)
    mean = np.einsum("kij,kj->ki", C, r)
    step, spread = mean[:, q : q + m], C[:, q : q + m, q : q + m]
    there = np.einsum("ki,ki->k", step, np.linalg.solve(spread, step[:, :, None])[:, :, 0])
    log_bayes = 0.5 * (np.linalg.slogdet(spread)[1] - np.linalg.slogdet(prior)[1] + there)
    before_variance = np.diagonal(C[:, :m, :m], axis1=1, axis2=2)
    both = np.diagonal(C[:, :m, q : q + m], axis1=1, axis2=2)
    after_variance = before_variance + 2.0 * both + np.diagonal(spread, axis1=1, axis2=2)
    return Steps(
        rows[1:],
        log_bayes,
        mean[:, :m],
        np.sqrt(np.maximum(before_variance, 0.0)),
        mean[:, :m] + step,
        np.sqrt(np.maximum(after_variance, 0.0)),
    )


def change_prior(size: Array, change_sd: float = CHANGE_SD) -> Array:
    """Covariance (m, m) of a change of the gains before the data.

    Args:
        size: (m,) of the gains.
        change_sd: relative.

    >>> change_prior(np.array([1.0, 2.0]), 1.0)
    array([[1. , 1.5],
           [1.5, 4. ]])
    """
    m = len(size)
    correlation = np.full((m, m), CHANGE_CORRELATION)
    correlation.flat[:: m + 1] = 1.0
    return np.asarray(change_sd**2 * np.outer(size, size) * correlation, float)


def covariance(parts: Array, columns: Columns, level: Level | None = None) -> Array:
    """Covariance (c - 1, c - 1) of the coefficients of a drive without a step.

    Args:
        parts: (b, c, c) inner products of its blocks.
        columns: names the columns.
        level: of the same blocks; None: the offset stays.
    """
    total, q = parts.sum(axis=0), len(columns.precision)
    M = total[None, :q, :q] + np.diag(columns.precision + 1e-9 * np.diag(total)[:q] + 1e-12)
    drifts = None if level is None else drifting_level.likeliest(parts, level, columns.precision)
    if level is not None and drifts is not None:
        cross = level.with_columns.sum(axis=0)
        of_cosines = level.with_each_other.sum(axis=0)
        M, _ = drifting_level.without(M, total[None, :q, -1], cross[None, :q], of_cosines, cross[-1], drifts)
    return np.asarray(np.linalg.inv(M[0]), float)


def mixture(value: Array, sd: Array, weight: Array) -> Interval:
    """Median and 95 % interval of a mixture of Gaussians.

    >>> mixture(np.array([5.0]), np.array([0.1]), np.ones(1)).value
    5.0
    """
    kept = weight > weighted_quantiles.MIN_WEIGHT * float(weight.max())
    points = value[kept, None] + sd[kept, None] * weighted_quantiles.GAUSSIAN_POINTS
    return weighted_quantiles.quantiles(points.ravel(), np.repeat(weight[kept], points.shape[1]))


def when(steps: Steps) -> tuple[float, float, float]:
    """Most likely row of the step, and the ends of its 95 % interval.

    >>> flat = np.zeros((3, 1))
    >>> when(Steps(np.array([10, 20, 30]), np.array([0.0, 9.0, 0.0]), flat, flat, flat, flat))
    (20.0, 20.0, 20.0)
    """
    weight = np.exp(steps.log_bayes - steps.log_bayes.max())
    below = np.cumsum(weight) / float(weight.sum())
    low, high = (float(steps.rows[int(np.searchsorted(below, q))]) for q in QUANTILES)
    return float(steps.rows[steps.best]), low, high
