"""Intelligent driver model (Treiber, Hennecke & Helbing 2000)."""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.rivals.rival_model import RivalModel, RivalParameter
from canid.values.types import Array


def acceleration(q: Array, gap: Array, speed: Array, lead: Array) -> Array:
    """Return the acceleration, m/s².

    Args:
        q: v0, T, s0, a, b.
        gap: m.
        speed: m/s.
        lead: m/s, the lead's speed.

    Example:
        >>> q = np.array([30.0, 1.5, 2.0, 1.0, 1.5])
        >>> float(acceleration(q, np.array(1e6), np.array(0.0), np.array(0.0)).round(3))
        1.0
    """
    v0, T, s0, a, b = q
    wanted = s0 + np.maximum(speed * (T + (speed - lead) / (2 * np.sqrt(a * b))), 0.0)
    free = np.square(np.square(speed / v0))
    out: Array = a * (1 - free - np.square(wanted / gap))
    return out


IDM = RivalModel(
    "IDM",
    "Treiber, Hennecke & Helbing 2000",
    (
        RivalParameter("v0", "m/s", 5.0, 80.0),
        RivalParameter("T", "s", 0.1, 4.0),
        RivalParameter("s0", "m", 0.5, 15.0),
        RivalParameter("a", "m/s²", 0.2, 4.0),
        RivalParameter("b", "m/s²", 0.3, 6.0),
    ),
    acceleration,
)
