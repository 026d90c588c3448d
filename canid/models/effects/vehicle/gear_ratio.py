"""Gear ratio: the same pedal gives more force in a lower gear."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import (
    DriveFeatures,
    Effect,
    Kind,
    Parameter,
    Params,
    Unavailable,
    Value,
    VehicleHooks,
    VehicleState,
    more_than,
)

MIDDLE_GEAR = 3.5  # of six gears: there the force is what Kp says


def thrust(p: Params, drive: Value, state: VehicleState) -> Value:
    """Return the lagged pedal times 1 + share·(3.5 − gear), %.

    Example:
        >>> state = VehicleState(0.0, 10.0, 20.0, 0.0, np.array([1.0, 6.0]), 10.0, 0.04)
        >>> thrust((0.1,), 10.0, state).tolist()
        [12.5, 7.5]
    """
    return drive * np.maximum(1 + p[0] * (MIDDLE_GEAR - state.gear), 0.05)


def unmeasured(drive: DriveFeatures) -> Unavailable | None:
    """Without the gear nothing shows it."""
    return (
        None
        if drive.gear_measured
        else Unavailable("the gear is not measured: map gear, and drive in several gears")
    )


EFFECT = Effect(
    id="gear_ratio",
    says="The driving force per % of pedal falls from gear to gear by a share of {share} of its middle value.",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("share", "1", -0.3, 0.38, (0.1,), 0.1),),
    needs=("pedal", "gear"),
    source="torque at the wheels = torque of the engine × ratio",
    decides="map gear, and drive in several gears",
    vehicle=VehicleHooks(thrust=thrust),
    unavailable=unmeasured,
    unusual=more_than(0.03),  # converters slip more in low gears
    found_at=((0.12,), (0.15,)),
    silent_at=((0.01,),),
)
