"""Forms of the baseline: which gap the driver wants at a speed, and in which unit the error is answered.

TIME_HEADWAY (Grover 2021, eq. 2.1)             e = gap/v − T
GAP (constant time gap, OVRV: Gunter et al. 2020)   e = (gap − s0 − T·v)/20 m/s
FREE_SPEED (IDM: Treiber, Hennecke & Helbing 2000)  e = gap/v − (T + s0/v)/sqrt(1 − (v/v0)⁴)

All errors are in s, so that K1 means the same in each: of GAP it is the gain on headway at 20 m/s.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from canid.models.effects.effect import Seen, Value

# m/s; the speed at which the gain on a gap error is that on a headway error
REFERENCE_SPEED = 20.0
# m/s; below it a headway is not meaningful
MIN_SPEED = 2.0
# (v/v0)⁴ at most: nearer to the free speed the wanted gap is as good as infinite
MAX_SPEED_TERM = 0.95


class Form(Enum):
    """A form of the baseline. The member's value is its public name."""

    TIME_HEADWAY = "time_headway"
    GAP = "gap"
    FREE_SPEED = "free_speed"


def error(form: Form, desired: Value, standstill: Value, free_speed: Value, seen: Seen) -> Value:
    """Return how far the driver is from the wanted gap, s.

    Args:
        form: of the baseline.
        desired: s, T.
        standstill: m, s0.
        free_speed: m/s, v0.
        seen: what the driver sees.

    Example:
        >>> seen = Seen(0.0, 600.0, 2.0, -1.0, 40.0, 20.0, 0.0)
        >>> [round(float(error(form, 1.5, 4.0, 30.0, seen)), 3) for form in Form]
        [0.5, 0.3, 0.102]
    """
    if form is Form.TIME_HEADWAY:
        return seen.headway - desired
    if form is Form.GAP:
        return (seen.gap - standstill - desired * seen.speed) / REFERENCE_SPEED
    speed = np.maximum(seen.speed, MIN_SPEED)
    free = np.sqrt(1.0 - np.minimum((speed / free_speed) ** 4, MAX_SPEED_TERM))
    return seen.headway - (desired + standstill / speed) / free
