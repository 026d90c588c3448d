"""Stretches of a flag: where it holds without a break."""

from __future__ import annotations

import numpy as np

from canid.findings import Flags
from canid.types import Array


def runs(flags: Flags) -> list[tuple[int, int]]:
    """Return [first, last + 1) of each unbroken stretch of True.

    Example:
        >>> runs(np.array([True, True, False, True]))
        [(0, 2), (3, 4)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(first), int(stop)) for first, stop in zip(edges[::2], edges[1::2], strict=True)]


def repeats(x: Array) -> list[tuple[int, int]]:
    """Return [first, last + 1) of each stretch of two or more samples with exactly the same value.

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
