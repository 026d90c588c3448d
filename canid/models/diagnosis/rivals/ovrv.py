"""Optimal velocity with relative velocity: constant time headway with range rate (Milanés & Shladover 2014)."""

from __future__ import annotations

from canid.models.diagnosis.rivals.rival_model import RivalModel, RivalParameter
from canid.values.types import Array


def acceleration(q: Array, gap: Array, speed: Array, lead: Array) -> Array:
    """Return the acceleration, m/s².

    Args:
        q: k1, k2, s0, T.
        gap: m.
        speed: m/s.
        lead: m/s, the lead's speed.

    Example:
        >>> import numpy as np
        >>> q = np.array([0.2, 0.5, 4.0, 1.5])
        >>> float(acceleration(q, np.array(39.0), np.array(20.0), np.array(21.0)))
        1.5
    """
    k1, k2, s0, T = q
    out: Array = k1 * (gap - s0 - T * speed) + k2 * (lead - speed)
    return out


OVRV = RivalModel(
    "OVRV",
    "Milanés & Shladover 2014",
    (
        RivalParameter("k1", "1/s²", 0.001, 1.0),
        RivalParameter("k2", "1/s", 0.0, 2.0),
        RivalParameter("s0", "m", 0.0, 40.0),
        RivalParameter("T", "s", 0.0, 5.0),
    ),
    acceleration,
)
