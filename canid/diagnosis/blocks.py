"""Doubt from blocks: what an estimate does when one stretch of the drive is left out (Künsch 1989, Quenouille 1956)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

from canid.findings import Flags
from canid.types import Array, Interval

# fewer cannot tell how much an estimate spreads
FEWEST = 6
DRAWS = 800


class Told(NamedTuple):
    """An estimate with its doubt."""

    value: Array  # (k,)
    sd: Array  # (k,)
    dof: int  # blocks − 1
    without: Array  # (blocks, k), each block left out in turn


def jackknife(estimate: Callable[[Flags], Array], block: npt.NDArray[np.int64]) -> Told | None:
    """Estimate, and leave each block out in turn; None: fewer than `FEWEST` blocks.

    Blocks longer than the noise's memory make the estimate's doubt right whatever its colour and however uneven it is.

    Args:
        estimate: rows that count (n,) -> (k,).
        block: (n,) number of the block of each row.

    Example:
        >>> x = np.random.default_rng(3).normal(size=400)
        >>> told = jackknife(lambda rows: np.array([x[rows].mean()]), np.arange(400) // 10)
        >>> round(float(told.sd[0]), 2), told.dof
        (0.05, 39)
    """
    numbers = np.unique(block)
    if numbers.size < FEWEST:
        return None
    whole = estimate(np.ones(block.size, dtype=bool))
    without = np.array([estimate(block != k) for k in numbers])
    m = numbers.size
    sd = np.sqrt((m - 1) / m * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
    return Told(whole, sd, m - 1, without)


def interval(value: float, sd: float, dof: int, chance: float = 0.05) -> Interval:
    """Return the interval that misses with this chance.

    Example:
        >>> round(interval(1.0, 0.5, 1000).high, 2)
        1.98
    """
    wide = float(student.isf(chance / 2, dof)) * sd
    return Interval(value, value - wide, value + wide)


def gain(before: Array, after: Array, block: npt.NDArray[np.int64], seed: int = 0) -> Interval:
    """Relative reduction of squared errors, 95 % by a bootstrap over blocks.

    Args:
        before: (n,) errors without, on rows that did not fit it.
        after: (n,) errors with.
        block: (n,) number of the block of each row.
        seed: of the draws: the same log gives the same interval.

    Example:
        >>> e = np.random.default_rng(1).normal(size=600)
        >>> round(gain(e, 0.5 * e, np.arange(600) // 20).value, 3)
        0.75
    """
    _, index = np.unique(block, return_inverse=True)
    b, a = np.bincount(index, before**2), np.bincount(index, after**2)
    if b.size < FEWEST or not b.sum() > 0:
        return Interval()
    draws = np.random.default_rng(seed).integers(0, b.size, (DRAWS, b.size))
    ratio = 1 - a[draws].sum(axis=1) / b[draws].sum(axis=1)
    low, high = np.quantile(ratio, (0.025, 0.975))
    return Interval(float(1 - a.sum() / b.sum()), float(low), float(high))
