"""Times that count from a log's own zero."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def check_own_times(times: npt.NDArray[np.int64]) -> None:
    """Raise ValueError for a time before the zero, which no format can hold.

    Args:
        times: (n,) ns or us since the zero.

    >>> check_own_times(np.array([0, 5]))
    >>> check_own_times(np.array([5, -1]))
    Traceback (most recent call last):
    ValueError: a time before the log's own zero: no log format holds that
    """
    if times.size and times.min() < 0:
        raise ValueError("a time before the log's own zero: no log format holds that")
