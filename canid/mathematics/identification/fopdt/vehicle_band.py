"""Answers to the inputs as vehicles move them, below some 1 Hz: what is above is the noise of their sensors.

That noise passes the lag in the model as the input itself does. Moved by 0.1 s it is other noise of the same size, so the
likelihood does not fall off with it; but its slopes by tau and by dead time add to Fisher's information, most where limits
or a calm lead leave little else. Of tau + dead time it says nothing.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from canid.mathematics.identification.output_filter import Kernel, filtered
from canid.values.types import Array

# s on either side of a local parabola, which halves the power at 1.3 Hz: a vehicle's speed moves below. On 39 drives of two
# simulators the bound of a dead time becomes 1.03 and 0.95 of that without the noise of sensors (0.78 and 0.63 with all of
# the band), which it changes by 3 %.
HALF_S = 0.5


def slow(answers: Array, step: float) -> Array:
    """Local parabola through each answer (Savitzky & Golay 1964), which is the answer to an input smoothed alike.

    Args:
        answers: (k, n), NaN where not known; stays where the parabola lacks a value, there 0 for NaN.
        step: s, between rows.

    >>> t = 0.1 * np.arange(100)
    >>> drive, noise = np.sin(t), 0.1 * (-1.0) ** np.arange(100)
    >>> bool(np.abs(slow((drive + noise)[None], 0.1)[0] - drive)[5:-5].max() < 0.02)
    True
    """
    by = parabola(step)
    out = np.empty_like(answers)
    for row, x in zip(out, answers, strict=True):
        smoothed, complete = filtered(by, x)
        row[:] = np.where(complete, smoothed, np.nan_to_num(x))
    return out


@cache
def parabola(step: float) -> Kernel:
    """The local parabola: the motion of vehicles passes."""
    half = max(round(HALF_S / step), 1)
    weights = 3.0 * half * (half + 1.0) - 1.0 - 5.0 * np.arange(-half, half + 1) ** 2
    return Kernel(weights / weights.sum(), half, half)
