"""Krauss's model of the safe speed (Krauss 1998) as SUMO has it: the gap allows the own stop behind that of the lead.

v T + v² / (2 b) = gap - s0 + v_lead² / (2 max(b, b_lead)); the safe speed is driven at once, within a and b.
"""

from __future__ import annotations

import numpy as np

from canid.analysis.sumo.eidm import PARAMETERS
from canid.models.diagnosis.rivals.rival_model import RivalModel, RivalParameter
from canid.values.types import Array

# s; of the calibration of all of SUMO's models: half the work of 0.2 s, errors on measured drives the same to 5 %
STEP_S = 0.4
# m/s²; SUMO's default of `decel`, which followers assume of a lead. `vehicle_types` writes it as `apparentDecel`
LEAD_DECEL = 4.5
# factor of SUMO 1.28 on the deceleration that is needed; m, least gap of the formula
AMPLIFIED, LEAST_GAP = 1.2, 0.01


def safe_speed(q: Array, gap: Array, lead: Array) -> Array:
    """Return the lesser of safe and wanted speed, m/s.

    Args:
        q: v0, T, s0, a, b.
        gap: m.
        lead: m/s, the lead's speed.

    Example:
        >>> q = np.array([40.0, 1.2, 2.0, 2.0, 3.0])
        >>> round(float(safe_speed(q, np.array(48.22), np.array(20.0))), 2)  # SUMO 1.28 keeps 20 m/s there
        20.0
    """
    v0, T, s0, _, b = q
    under = np.square(b * T) + 2 * b * (gap - s0) + np.square(lead) * (b / np.maximum(b, LEAD_DECEL))
    out: Array = np.minimum(np.sqrt(np.maximum(under, 0.0)) - b * T, v0)
    return out


def acceleration(q: Array, gap: Array, speed: Array, lead: Array) -> Array:
    """Return the acceleration, m/s²: to the safe speed within one step of the simulation.

    Args:
        q: v0, T, s0, a, b.
        gap: m.
        speed: m/s.
        lead: m/s, the lead's speed.

    Example:
        >>> q = np.array([40.0, 1.2, 2.0, 2.0, 3.0])
        >>> float(acceleration(q, np.array(200.0), np.array(20.0), np.array(20.0)))
        2.0
    """
    _, _, s0, a, b = q
    free = np.maximum(gap - s0, LEAST_GAP)
    # SUMO brakes harder than b only as far as the situation needs it: to stand behind the lead, or to reach its speed
    stand = np.square(speed) / (2 * (free + np.square(lead) / (2 * LEAD_DECEL)))
    reach = (np.square(speed) - np.square(lead)) / (2 * free)
    hardest = np.maximum(AMPLIFIED * np.where(stand <= LEAD_DECEL, stand, reach), b)
    out: Array = np.minimum(np.maximum((safe_speed(q, gap, lead) - speed) / STEP_S, -hardest), a)
    return out


KRAUSS = RivalModel(
    "Krauss",
    "Krauss 1998",
    (*PARAMETERS[:4], RivalParameter("b", "m/s²", 0.5, 8.0)),
    acceleration,
)
