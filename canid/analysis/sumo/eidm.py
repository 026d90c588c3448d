"""Improved intelligent driver model (Treiber & Kesting 2013, section 11.3.7) with the constants of SUMO's EIDM.

EIDM (Salles, Kaufmann & Reuss 2020) adds to it a stochastic error of the acceleration with a correlation time. Its reaction
time, its errors of perception and its coolness are off here: `vehicle_types` writes them as 0.
"""

from __future__ import annotations

import numpy as np

from canid.models.diagnosis.rivals.rival_model import RivalModel, RivalParameter
from canid.values.types import Array

# m; SUMO 1.28: what EIDM takes off the gap, and adds to the gap at rest
GAP_OFF, REST_ADDED = 0.25, 0.05
# m; least gap of the formula
LEAST_GAP = 1e-3
# least share of a that is left below the wanted speed: the exponent 2 a / a_free stays a number
LEAST_FREE = 1e-6

# those of IDM as well, and of Krauss but for b. In a traffic simulation the driver also stops at junctions: no gap at rest
# below 1 m, and no braking more gently than 0.5 m/s², which would begin 200 m before a traffic light
PARAMETERS = (
    RivalParameter("v0", "m/s", 5.0, 80.0),
    RivalParameter("T", "s", 0.1, 4.0),
    RivalParameter("s0", "m", 1.0, 15.0),
    RivalParameter("a", "m/s²", 0.2, 4.0),
    RivalParameter("b", "m/s²", 0.5, 6.0),
)


def acceleration(q: Array, gap: Array, speed: Array, lead: Array) -> Array:
    """Return the acceleration, m/s².

    Args:
        q: v0, T, s0, a, b.
        gap: m.
        speed: m/s.
        lead: m/s, the lead's speed.

    Example:
        >>> q = np.array([30.0, 1.5, 2.0, 1.0, 1.5])
        >>> abs(float(acceleration(q, np.array(32.3), np.array(20.0), np.array(20.0)).round(6)))
        0.0
    """
    v0, T, s0, a, b = q
    wanted = s0 + REST_ADDED + np.maximum(speed * (T + (speed - lead) / (2 * np.sqrt(a * b))), 0.0)
    z = wanted / np.maximum(gap - GAP_OFF, LEAST_GAP)
    share = speed / v0
    below = np.maximum(1 - np.square(np.square(np.minimum(share, 1.0))), LEAST_FREE)
    # faster than wanted: b (1 - (v0 / v)^(4 a / b)) is braked
    above = b * (1 - np.maximum(share, 1.0) ** (-4 * a / b))
    near = a * (1 - np.square(z)) - above
    far = np.where(share <= 1.0, a * below * (1 - np.minimum(z, 1.0) ** (2 / below)), -above)
    out: Array = np.where(z >= 1.0, near, far)
    return out


EIDM = RivalModel("EIDM", "Treiber & Kesting 2013; Salles, Kaufmann & Reuss 2020", PARAMETERS, acceleration)
