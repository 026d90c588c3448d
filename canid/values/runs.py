"""Runs: unbroken stretches of True, or of one value, as half-open index ranges [first, stop)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Flags = npt.NDArray[np.bool_]


def runs(flags: Flags, longer_than: int = 0) -> list[tuple[int, int]]:
    """Return [first, stop) of each unbroken stretch of True.

    Args:
        flags: (n,).
        longer_than: samples; stretches of so many and fewer are left out.

    Example:
        >>> runs(np.array([True, True, False, True]))
        [(0, 2), (3, 4)]
        >>> runs(np.array([True, True, False, True]), longer_than=1)
        [(0, 2)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(int(first), int(stop)) for first, stop in pairs if stop - first > longer_than]


def repeats(x: npt.NDArray[Any]) -> list[tuple[int, int]]:
    """Return [first, stop) of each stretch of two or more samples with exactly the same value.

    Example:
        >>> repeats(np.array([1.0, 2.0, 2.0, 2.0, np.nan, np.nan]))
        [(1, 4)]
    """
    return [(first, stop + 1) for first, stop in runs(x[1:] == x[:-1])]


def lasting(flags: Flags, samples: int) -> Flags:
    """Keep the stretches that last at least so many samples.

    Example:
        >>> lasting(np.array([True, True, False, True]), 2)
        array([ True,  True, False, False])
    """
    out = np.zeros_like(flags)
    for first, stop in runs(flags):
        out[first:stop] = stop - first >= samples
    return out
