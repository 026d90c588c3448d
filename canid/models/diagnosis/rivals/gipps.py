"""Gipps's model of the safe speed (Gipps 1981)."""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.rivals.rival_model import RivalModel, RivalParameter
from canid.values.types import Array


def acceleration(q: Array, gap: Array, speed: Array, lead: Array) -> Array:
    """Return the acceleration, m/s²: towards Gipps's speed within the reaction time.

    With steps of one reaction time this is Gipps's own recursion, his margin of half a reaction time included.

    Args:
        q: v0, a, b, tau, s0, b_lead (both decelerations positive).
        gap: m.
        speed: m/s.
        lead: m/s, the lead's speed.

    Example:
        >>> q = np.array([20.0, 1.5, 3.0, 1.0, 2.0, 3.0])
        >>> float(acceleration(q, np.array(1e6), np.array(20.0), np.array(20.0)))
        0.0
    """
    v0, a, b, tau, s0, b_lead = q
    share = speed / v0
    free = speed + 2.5 * a * tau * (1 - share) * np.sqrt(1 / 40 + share)
    under = np.square(b * tau) + b * (2 * (gap - s0) - speed * tau + np.square(lead) / b_lead)
    safe = np.sqrt(np.maximum(under, 0.0)) - b * tau
    out: Array = (np.minimum(free, safe) - speed) / tau
    return out


GIPPS = RivalModel(
    "Gipps",
    "Gipps 1981",
    (
        RivalParameter("v0", "m/s", 5.0, 80.0),
        RivalParameter("a", "m/s²", 0.2, 4.0),
        RivalParameter("b", "m/s²", 0.5, 8.0),
        RivalParameter("tau", "s", 0.2, 4.0),
        RivalParameter("s0", "m", 0.5, 15.0),
        RivalParameter("b_lead", "m/s²", 0.5, 10.0),
    ),
    acceleration,
)
