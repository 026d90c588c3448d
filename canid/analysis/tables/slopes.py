"""Slope of a column over time by a local parabola (Savitzky & Golay 1964), where a table lacks accelerations or speeds."""

from __future__ import annotations

import numpy as np

from canid.values.types import NAN, Array

# s; as the accelerations of the OpenACC logs were made: noise of 0.05 m/s in the speed leaves 0.02 m/s² at 10 Hz
ACCEL_WIDTH_S = 1.1
# s; positions are finer than speeds, and the speed is an input: it must not be late or smoothed
SPEED_WIDTH_S = 0.5
# steps; a longer pause is not bridged
MAX_STEPS = 3.5


def slope(t: Array, x: Array, width: float) -> Array:
    """Slope at each row; NaN where half the width before or after it has no values.

    Args:
        t: (n,) s, ascending.
        x: (n,).
        width: s, of the local parabola.

    Example:
        >>> t = 0.1 * np.arange(20)
        >>> slope(t, 3.0 * t, 0.5)[[0, 5]].round(9)
        array([nan,  3.])
    """
    out = np.full(len(t), NAN)
    known = np.flatnonzero(np.isfinite(t) & np.isfinite(x))
    known = known[np.concatenate([[True], np.diff(t[known]) > 0.0])] if known.size else known
    if known.size < 3:
        return out
    times, values = t[known], x[known]
    step = float(np.median(np.diff(times)))
    half = max(round((width / step - 1.0) / 2.0), 1)
    weights = -np.arange(-half, half + 1.0)
    weights /= (np.arange(-half, half + 1.0) ** 2).sum() * step
    cuts = np.flatnonzero(np.diff(times) > MAX_STEPS * step) + 1
    for part in np.split(np.arange(len(times)), cuts):
        if len(part) < 2 * half + 1:
            continue
        part_times = times[part]
        n = round((part_times[-1] - part_times[0]) / step)
        grid = part_times[0] + step * np.arange(n + 1)
        regular = len(grid) == len(part_times) and np.allclose(grid, part_times, atol=0.05 * step)
        even = values[part] if regular else np.interp(grid, part_times, values[part])
        slopes = np.full(len(grid), NAN)
        if len(even) >= len(weights):
            slopes[half : len(even) - half] = np.convolve(even, weights, mode="valid")
        out[known[part]] = slopes if regular else np.interp(part_times, grid, slopes)
    return out
