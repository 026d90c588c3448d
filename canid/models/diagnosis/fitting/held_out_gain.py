"""Relative reduction of the error's variance on held-out data, with an interval by the block bootstrap (Künsch 1989)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import QUANTILES
from canid.values.types import Array, Interval

DRAWS = 800


def gain(
    before: Array, after: Array, block: npt.NDArray[np.int64], min_blocks: int, seed: int = 0
) -> Interval:
    """Return 1 − Σ after / Σ before; NaN with too few blocks.

    Args:
        before: (n,) squared errors of the model without, on rows that did not fit it.
        after: (n,) squared errors of the model with.
        block: (n,) number of the block of each row; blocks longer than the noise's memory are independent.
        min_blocks: fewer do not show how much the gain varies.
        seed: of the draws: the same log gives the same interval.

    Example:
        >>> e = np.random.default_rng(1).normal(size=6000) ** 2
        >>> found = gain(e, 0.5 * e, np.arange(6000) // 150, 4)
        >>> round(found.value, 3), round(found.low, 3)
        (0.5, 0.5)
    """
    return bootstrapped((before, after), block, min_blocks, lambda sums: 1 - sums[1] / sums[0], seed)


def bootstrapped(
    columns: Sequence[Array],
    block: npt.NDArray[np.int64],
    min_blocks: int,
    statistic: Callable[[Array], Array],
    seed: int = 0,
) -> Interval:
    """Statistic of sums of columns, with an interval by a bootstrap of blocks; NaN with too few blocks.

    Args:
        columns: (n,) each; a block in which the first one has no sum does not count.
        block: (n,) number of the block of each row.
        min_blocks: fewer do not show how much the statistic varies.
        statistic: sums (k, ...) -> (...).
        seed: of the draws.

    Example:
        >>> ones = np.ones(100)
        >>> bootstrapped((ones, 2 * ones), np.arange(100) // 10, 4, lambda sums: sums[1] / sums[0])
        Interval(value=2.0, low=2.0, high=2.0)
    """
    index = np.unique(block, return_inverse=True)[1]
    sums = np.stack([np.bincount(index, column) for column in columns])
    sums = sums[:, sums[0] > 0]
    if sums.shape[1] < min_blocks:
        return Interval()
    draws = np.random.default_rng(seed).integers(0, sums.shape[1], (DRAWS, sums.shape[1]))
    low, high = np.quantile(statistic(sums[:, draws].sum(axis=2)), QUANTILES)
    return Interval(float(statistic(sums.sum(axis=1))), float(low), float(high))
