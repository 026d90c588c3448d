"""A row of block characters that shows the course of a signal."""

from __future__ import annotations

import numpy as np

from canid.values.types import Array

_BLOCKS = "▁▂▃▄▅▆▇█"


def sparkline(values: Array, width: int = 32) -> str:
    """Draw the course of a signal.

    Args:
        values: (n,) samples at equal steps; NaN: not measured.
        width: characters.

    Returns:
        One character for each part of the time: its mean between the least and the largest; blank: not measured.

    Example:
        >>> sparkline(np.array([0.0, 1.0, 2.0, 3.0, np.nan, np.nan]), 3)
        '▁█ '
    """
    means = []
    for part in np.array_split(values, min(width, max(len(values), 1))):
        finite = part[np.isfinite(part)]
        means.append(float(finite.mean()) if len(finite) else np.nan)
    heights = np.array(means)
    if not np.isfinite(heights).any():
        return " " * len(heights)
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    span = high - low or 1.0
    return "".join(
        " " if not np.isfinite(value) else _BLOCKS[round((value - low) / span * (len(_BLOCKS) - 1))]
        for value in heights
    )
