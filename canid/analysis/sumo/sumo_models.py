"""The list of SUMO's car-following models that a driver is fitted to, and how each of them is made stochastic.

EIDM has an error of the acceleration of its own. The others see a wrong gap or range rate by SUMO's driver state device: an
Ornstein-Uhlenbeck process times the gap (`sensitivity`, per unit of that process). Krauss sets the speed, so the noise is
that of the speed.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from canid.analysis.sumo.acc import ACC
from canid.analysis.sumo.eidm import EIDM, PARAMETERS
from canid.analysis.sumo.krauss import KRAUSS, STEP_S
from canid.models.diagnosis.rivals import idm
from canid.models.diagnosis.rivals.rival_model import RivalModel
from canid.models.diagnosis.rivals.rival_simulation import Leads
from canid.values.types import NAN, Array

IDM = idm.IDM._replace(parameters=PARAMETERS)
# relative step of the derivatives
DERIVATIVE_STEP = 1e-3


class SumoModel(NamedTuple):
    """A model and what the driver's error acts on."""

    rival: RivalModel
    error_of: Literal["accel", "gap", "range_rate"]
    noise_of: Literal["accel", "speed"]

    @property
    def name(self) -> str:
        """SUMO's name of it."""
        return self.rival.name


# first the one whose noise SUMO reproduces best (docs/evidence/sumo.md): it is taken where others are not better
MODELS = (
    SumoModel(IDM, "gap", "accel"),
    SumoModel(EIDM, "accel", "accel"),
    SumoModel(ACC, "range_rate", "accel"),
    SumoModel(KRAUSS, "gap", "speed"),
)
BY_NAME = {model.name: model for model in MODELS}


def sensitivity(model: SumoModel, q: Array, stretches: Leads) -> float:
    """What the error's process does to acceleration or speed, rms over the drive; 1 where it is added to them as it is.

    Args:
        model: which one.
        q: (k,) its parameters.
        stretches: the stretches.
    """
    if model.error_of == "accel":
        return 1.0
    rival = model.rival
    at = [x[stretches.inside] for x in (stretches.gap, stretches.speed, stretches.lead)]
    rest = float(q[[parameter.name for parameter in rival.parameters].index("s0")])
    # SUMO's error is relative to the gap without the one at rest
    seen = DERIVATIVE_STEP * np.maximum(at[0] - rest, 0.0)
    wrong = [at[0] + seen, at[1], at[2]] if model.error_of == "gap" else [at[0], at[1], at[2] + seen]
    p = q[:, None]
    moved = (rival.acceleration(p, *wrong) - rival.acceleration(p, *at)) / DERIVATIVE_STEP
    out = float(np.sqrt(np.mean(moved**2))) if moved.size else NAN
    return out * STEP_S if model.noise_of == "speed" else out
