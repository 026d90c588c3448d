"""Limit of the engine's power: the force falls with speed, whatever the pedal demands."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import (
    DriveFeatures,
    Effect,
    Kind,
    Parameter,
    Params,
    Screening,
    Value,
    VehicleHooks,
    VehicleState,
)
from canid.values.types import Interval

# W/kg; passenger cars are sold with 35 to 100 W per kg of their laden mass, so less than that is a cause: a lorry, a
# trailer, limp-home
SOLD_FROM = 35.0


def thrust(p: Params, drive: Value, state: VehicleState) -> Value:
    """Return the lagged pedal that the power allows, %: Kp·D·v ≤ power.

    Example:
        >>> state = VehicleState(0.0, 30.0, np.array([10.0, 30.0]), 0.0, 4.0, 30.0, 0.04)
        >>> thrust((18.0,), 30.0, state).tolist()
        [30.0, 15.0]
    """
    return np.minimum(drive, p[0] / (np.maximum(state.strength, 1e-3) * np.maximum(state.speed, 1.0)))


def among_powers(drive: DriveFeatures) -> tuple[float, ...]:
    """High quantiles of the demanded power, W/kg: there a limit acts."""
    return tuple(float(x) for x in np.quantile(drive.power, (0.7, 0.9, 0.97)))


def weak(estimate: Interval, drive: DriveFeatures) -> bool:
    """Is it surely less than cars are sold with?"""
    return estimate.high < SOLD_FROM


EFFECT = Effect(
    id="power_limit",
    says="The engine delivers no more than {power} W per kg.",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("power", "W/kg", 1.0, 200.0, among_powers, 15.0),),
    needs=("pedal", "speed"),
    source="force = power / speed",
    decides="full pedal at high speed",
    vehicle=VehicleHooks(thrust=thrust),
    # a limit that is there may be all that keeps this drive from showing a stronger pull
    screening=Screening.DIRECTION,
    unusual=weak,
    found_at=((4.0,), (5.0,)),
    silent_at=((80.0,),),
)
