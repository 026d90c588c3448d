"""The difference of two means of a quantity as a weighted integral of its rate, without a derivative of the quantity.

With means g1 and g2 over [-T, 0] and [0, T], integration by parts gives (s from 0 to T)

    g2 - g1 = ∫ rate(s - T) s/T ds + ∫ rate(s) (1 - s/T) ds

a triangle whose weight rises over the first interval to 1 between the two, and falls over the second. A sample counts with
the weight in the middle of its step, which is the trapezoidal rule.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.types import Array


class Integrals(NamedTuple):
    """Weighted integrals of a rate over one block, in the unit of the quantity."""

    rise: float = (
        0.0  # with the weight that rises: to the difference from this block's mean to the next one's
    )
    fall: float = 0.0  # with the weight that falls: to the difference from the mean before to this block's


def integrals(rate: Array, dt: float) -> Integrals:
    """Integrate a rate over a block.

    Args:
        rate: (n,) samples.
        dt: s, between samples.

    Example:
        >>> speed = 20.0 + 0.5 * np.arange(20.0)  # m/s: 0.5 m/s more from sample to sample, so 5 m/s²
        >>> first, second = (integrals(np.full(10, 5.0), 0.1) for _ in range(2))
        >>> round(first.rise + second.fall, 9), float(speed[10:].mean() - speed[:10].mean())
        (5.0, 5.0)
    """
    n = len(rate)
    rise = float(rate @ (np.arange(n) + 0.5)) / n * dt
    return Integrals(rise, float(rate.sum()) * dt - rise)
