"""Long lines thinned so that a page stays fluent, without losing a peak: the extremes of each bucket."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.types import Array

# Points that a line may have: 10 min at 10 Hz are drawn as they are, and a screen is 2,000 px wide.
MOST = 6000


def kept(y: Array, keep: npt.NDArray[np.bool_], most: int = MOST) -> npt.NDArray[np.int64]:
    """Choose the samples of a line that are drawn.

    Args:
        y: (n,) the line, NaN where there is none.
        keep: (n,) samples that are drawn in any case.
        most: how many samples are drawn as they are; of a longer line about as many, beside those in `keep`.

    Returns:
        Indices in ascending order: all where n ≤ most; else the smallest and the largest of each bucket, so that no peak
        is lost, and both sides of each gap, so that it stays one.

    Example:
        >>> wave = np.sin(np.arange(10000) / 7)
        >>> at = kept(wave, np.zeros(10000, dtype=bool), most=1000)
        >>> len(at) <= 1000, float(wave[at].max() - wave.max())
        (True, 0.0)
    """
    n = len(y)
    if n <= most:
        return np.arange(n)
    size = -(-2 * n // most)
    padded = np.full(-(-n // size) * size, np.nan)
    padded[:n] = y
    buckets = padded.reshape(-1, size)
    known = np.isfinite(buckets)
    first = size * np.arange(len(buckets))
    low = first + np.argmin(np.where(known, buckets, np.inf), axis=1)
    high = first + np.argmax(np.where(known, buckets, -np.inf), axis=1)
    edge = np.flatnonzero(np.diff(np.isfinite(y)))
    return np.unique(np.concatenate([np.flatnonzero(keep), low, high, edge, edge + 1]))
