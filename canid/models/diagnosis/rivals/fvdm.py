"""Full velocity difference model (Jiang, Wu & Zhu 2001)."""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.rivals.rival_model import RivalModel, RivalParameter
from canid.values.types import Array


def acceleration(q: Array, gap: Array, speed: Array, lead: Array) -> Array:
    """Return the acceleration, m/s².

    Optimal velocity v0 (tanh(s/l − β) + tanh β) / (1 + tanh β): the one of Jiang et al., written so that it is 0 at a gap
    of 0 (Treiber & Kesting 2013, eq. 10.22).

    Args:
        q: v0, length, shape (β), tau, sensitivity.
        gap: m.
        speed: m/s.
        lead: m/s, the lead's speed.

    Example:
        >>> q = np.array([20.0, 15.0, 1.5, 2.0, 0.5])
        >>> abs(float(acceleration(q, np.array(1e6), np.array(20.0), np.array(20.0)).round(3)))
        0.0
    """
    v0, length, shape, tau, sensitivity = q
    base = np.tanh(shape)
    optimal = v0 * (np.tanh(gap / length - shape) + base) / (1 + base)
    out: Array = (optimal - speed) / tau + sensitivity * (lead - speed)
    return out


FVDM = RivalModel(
    "FVDM",
    "Jiang, Wu & Zhu 2001",
    (
        RivalParameter("v0", "m/s", 5.0, 80.0),
        RivalParameter("length", "m", 2.0, 80.0),
        RivalParameter("shape", "1", 0.05, 5.0),
        RivalParameter("tau", "s", 0.3, 100.0),
        RivalParameter("sensitivity", "1/s", 0.0, 2.0),
    ),
    acceleration,
)
