"""Block jackknife: standard errors from estimates with one stretch of the drive left out (Quenouille 1956, Künsch 1989)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

from canid.findings import Flags
from canid.identification.confidence import MISS
from canid.types import Array, Interval

# fewer do not show how much an estimate varies
MIN_BLOCKS = 6


class Jackknife(NamedTuple):
    """An estimate with its standard error."""

    value: Array  # (k,)
    sd: Array  # (k,)
    dof: int  # blocks − 1
    without: Array  # (blocks, k), each block left out in turn


def jackknife(estimate: Callable[[Flags], Array], block: npt.NDArray[np.int64]) -> Jackknife | None:
    """Estimate, and leave each block out in turn; None: fewer than `MIN_BLOCKS` blocks.

    Blocks longer than the noise's memory make the standard error right whatever the noise's spectrum and scale.

    Args:
        estimate: rows that count (n,) -> (k,).
        block: (n,) number of the block of each row.

    Example:
        >>> x = np.random.default_rng(3).normal(size=400)
        >>> found = jackknife(lambda rows: np.array([x[rows].mean()]), np.arange(400) // 10)
        >>> round(float(found.sd[0]), 2), found.dof
        (0.05, 39)
    """
    numbers = np.unique(block)
    if numbers.size < MIN_BLOCKS:
        return None
    whole = estimate(np.ones(block.size, dtype=bool))
    without = np.array([estimate(block != k) for k in numbers])
    m = numbers.size
    sd = np.sqrt((m - 1) / m * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
    return Jackknife(whole, sd, m - 1, without)


def interval(value: float, sd: float, dof: int, chance: float = MISS) -> Interval:
    """Return the interval that misses with this chance.

    Example:
        >>> round(interval(1.0, 0.5, 1000).high, 2)
        1.98
    """
    wide = float(student.isf(chance / 2, dof)) * sd
    return Interval(value, value - wide, value + wide)
