"""Step-down adjusted p-values for several tests at once, with the correlation of their statistics where it is known.

Westfall & Young 1993 (maxT, step-down) under a normal approximation. Statistics of known correlation form a block, whose
maximum is simulated; of blocks whose mutual correlation is not known the probabilities are multiplied, which is conservative
whatever it is (Royen 2014, the Gaussian correlation inequality; of single statistics Šidák 1967).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from canid.mathematics.identification.confidence import LEVEL
from canid.values.types import Array

# simulated maxima: an adjusted p-value of 0.05 is then known to 0.001
SIMULATED = 40_000
BISECTIONS = 40


class Block(NamedTuple):
    """Statistics of known correlation."""

    members: tuple[int, ...]  # their places in the list of all
    correlation: Array  # (k, k)


def adjusted(z: Sequence[float], blocks: Sequence[Block] = ()) -> Array:
    """Family-wise p-values, two-sided.

    Args:
        z: (m,) standard normal under the null.
        blocks: of known correlation, disjoint; a statistic in none is a block of its own.

    Returns:
        (m,), in the order of `z`.

    >>> [round(float(p), 3) for p in adjusted([3.0, 0.1])]
    [0.005, 0.92]
    >>> same = Block((0, 1), np.ones((2, 2)))
    >>> abs(float(adjusted([2.0, 2.0], [same])[0]) - 0.0455) < 0.004
    True
    """
    size = np.abs(np.asarray(z, dtype=np.float64))
    family = _family(len(size), blocks)
    out = np.zeros(len(size))
    least = 0.0
    order = np.argsort(-size, kind="stable")
    for i, k in enumerate(order):
        left = frozenset(order[i:].tolist())
        least = max(least, _exceeded(family, float(size[k]), left))
        out[k] = least
    return out


def critical_value(count: int, blocks: Sequence[Block] = ()) -> float:
    """Half-width, in standard deviations, of intervals that all hold their truth with 95 %.

    Args:
        count: m.
        blocks: as in `adjusted`.

    >>> round(critical_value(1), 1), round(critical_value(10), 1)
    (2.0, 2.8)
    """
    family, every = _family(count, blocks), frozenset(range(count))
    low, high = 0.0, 10.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _exceeded(family, middle, every) > 1.0 - LEVEL else (low, middle)
    return high


class _Simulated(NamedTuple):
    members: tuple[int, ...]
    sizes: Array | None  # (SIMULATED, k) absolute values; None: one statistic


def _family(count: int, blocks: Sequence[Block]) -> list[_Simulated]:
    taken = {k for block in blocks for k in block.members}
    out = [_Simulated((k,), None) for k in range(count) if k not in taken]
    # the same statistics give the same p-values: no verdict may depend on chance
    rng = np.random.default_rng(0)
    for block in blocks:
        value, vector = np.linalg.eigh(block.correlation)
        root = vector * np.sqrt(np.maximum(value, 0.0))
        drawn = rng.standard_normal((SIMULATED, len(value))) @ root.T
        scale = np.sqrt(np.maximum(np.sum(root**2, axis=1), 1e-12))
        out.append(_Simulated(block.members, np.abs(drawn / scale)))
    return out


def _exceeded(family: Sequence[_Simulated], size: float, left: frozenset[int]) -> float:
    """Probability that one of the statistics that are left is as large."""
    within = 1.0
    for block in family:
        in_block = [i for i, k in enumerate(block.members) if k in left]
        if not in_block:
            continue
        each = float(2.0 * norm.sf(size))
        by_sidak = 1.0 - (1.0 - each) ** len(in_block)
        if block.sizes is None or len(in_block) == 1:
            within *= 1.0 - by_sidak
            continue
        simulated = float(np.sum(block.sizes[:, in_block].max(axis=1) >= size) + 1) / (SIMULATED + 1)
        within *= 1.0 - min(by_sidak, simulated)
    return 1.0 - within
