"""Means over time on a grid whose step doubles as the log goes on: how long it will be need not be known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array

# points of a course: a terminal of 200 columns draws no more
BUCKETS = 128
# s that the grid spans at first
FIRST_SPAN_S = 1.0


class Grid(NamedTuple):
    """The grid of all courses of a log."""

    start: float  # s
    step: float  # s

    def bucket(self, t: Array) -> npt.NDArray[np.intp]:
        """Which bucket each time belongs to; times before the start belong to the first one."""
        index: npt.NDArray[np.intp] = np.clip((t - self.start) / self.step, 0, BUCKETS - 1).astype(np.intp)
        return index


def grid(start: float) -> Grid:
    """The grid at the beginning.

    Example:
        >>> grid(2.0).step * BUCKETS
        1.0
    """
    return Grid(start, FIRST_SPAN_S / BUCKETS)


def doublings(grid: Grid, stop: float) -> int:
    """How often the step must double for the grid to hold a time.

    Example:
        >>> doublings(grid(0.0), 0.9), doublings(grid(0.0), 1.0), doublings(grid(0.0), 60.0)
        (0, 1, 6)
    """
    n = 0
    while stop - grid.start >= grid.step * 2**n * BUCKETS:
        n += 1
    return n


def doubled(sums: Array) -> Array:
    """Merge the buckets in pairs: (128,) -> (128,), the second half empty.

    Example:
        >>> doubled(np.ones(BUCKETS))[[0, 63, 64]].tolist()
        [2.0, 2.0, 0.0]
    """
    merged: Array = np.concatenate([sums.reshape(-1, 2).sum(axis=1), np.zeros(BUCKETS // 2)])
    return merged


def means(sums: Array, counts: Array, used: int) -> Array:
    """Means of the buckets that the log fills; NaN where nothing came.

    Example:
        >>> means(np.array([4.0, 0.0, 9.0]), np.array([2.0, 0.0, 3.0]), 3).tolist()
        [2.0, nan, 3.0]
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        mean: Array = np.where(counts[:used] > 0, sums[:used] / counts[:used], np.nan)
    return mean
