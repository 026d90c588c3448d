"""Linear control of gap and range rate as SUMO's ACC has it (Xiao, Wang & van Arem 2017): canid's driver without lag.

SUMO has three sets of gains, for a gap that is kept, too large and too small; with the same gains in all of them its law is
linear, but for a margin of the gap at low speed (Xiao et al. 2018).
"""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.rivals.ovrv import OVRV
from canid.models.diagnosis.rivals.rival_model import RivalModel, RivalParameter
from canid.values.types import Array

# m/s; SUMO 1.28: below the first the margin is 2 m, above the second it is 0, between them 75 m²/s / speed - 5 m
MARGIN_BELOW, MARGIN_ABOVE = 10.8, 15.0


def margin(speed: Array) -> Array:
    """Return what is added to the gap at rest, m.

    Example:
        >>> margin(np.array([5.0, 12.5, 20.0]))
        array([2., 1., 0.])
    """
    inner = 75.0 / np.maximum(speed, MARGIN_BELOW) - 5.0
    out: Array = np.where(speed < MARGIN_BELOW, 2.0, np.where(speed <= MARGIN_ABOVE, inner, 0.0))
    return out


def acceleration(q: Array, gap: Array, speed: Array, lead: Array) -> Array:
    """Return the acceleration, m/s².

    Args:
        q: k1, k2, s0, T.
        gap: m.
        speed: m/s.
        lead: m/s, the lead's speed.

    Example:
        >>> q = np.array([0.1, 0.5, 2.0, 1.2])
        >>> float(acceleration(q, np.array(40.0), np.array(20.0), np.array(22.0)).round(6))  # as SUMO 1.28
        2.4
    """
    k1, k2, s0, T = q
    out: Array = k1 * (gap - s0 - margin(speed) - T * speed) + k2 * (lead - speed)
    return out


ACC = RivalModel(
    "ACC",
    "Milanés & Shladover 2014; Xiao, Wang & van Arem 2017",
    (*OVRV.parameters[:3], RivalParameter("T", "s", 0.1, 5.0)),
    acceleration,
)
