"""Min–max decimation of long lines: the extremes of each bucket, so that no peak is lost."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from canid.values.types import Array

# points of a line: 10 min at 10 Hz are drawn as they are, and a screen is 2,000 px wide
MAX_POINTS = 6000


def min_max_indices(y: Array, keep: npt.NDArray[np.bool_], most: int = MAX_POINTS) -> npt.NDArray[np.int64]:
    """Indices of the samples that are drawn of a line.

    Args:
        y: (n,) the line, NaN where there is none.
        keep: (n,) samples that are always drawn.
        most: a line of up to so many samples is drawn as it is; of a longer one about as many and those in `keep`.

    Returns:
        Indices in ascending order: all where n ≤ most; else the smallest and the largest of each bucket, so that no peak
        is lost, and both ends of each gap, so that it remains one.

    Example:
        >>> wave = np.sin(np.arange(10000) / 7)
        >>> at = min_max_indices(wave, np.zeros(10000, dtype=bool), most=1000)
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
