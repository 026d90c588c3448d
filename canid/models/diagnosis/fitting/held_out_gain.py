"""Relative reduction of the error's variance on held-out data, with an interval by the block bootstrap (Künsch 1989)."""

from __future__ import annotations

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
    _, index = np.unique(block, return_inverse=True)
    b, a = np.bincount(index, before), np.bincount(index, after)
    b, a = b[b > 0], a[b > 0]
    if b.size < min_blocks:
        return Interval()
    draws = np.random.default_rng(seed).integers(0, b.size, (DRAWS, b.size))
    ratio = 1 - a[draws].sum(axis=1) / b[draws].sum(axis=1)
    low, high = np.quantile(ratio, QUANTILES)
    return Interval(float(1 - a.sum() / b.sum()), float(low), float(high))
