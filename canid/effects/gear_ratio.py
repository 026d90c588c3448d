"""The same pedal pulls more in a lower gear."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Car, CarSeen, Effect, Parameter, Params, Value

MIDDLE = 3.5  # of six gears: where the pull is what Kp says


def thrust(p: Params, drive: Value, seen: CarSeen) -> Value:
    """Return the drive times 1 + share·(3.5 − gear), %.

    Example:
        >>> seen = CarSeen(0.0, 10.0, 20.0, 0.0, np.array([1.0, 6.0]), 10.0, 0.04)
        >>> thrust((0.1,), 10.0, seen).tolist()
        [12.5, 7.5]
    """
    return drive * np.maximum(1 + p[0] * (MIDDLE - seen.gear), 0.05)


EFFECT = Effect(
    id="gear_ratio",
    says="The pull falls by a share of {share} of its middle value from gear to gear.",
    where="vehicle",
    kind="curve",
    parameters=(Parameter("share", "1", -0.3, 0.38, (0.1,), 0.1),),
    needs=("pedal", "gear"),
    source="torque at the wheels = torque of the engine × ratio",
    decides="map gear, and drive in several gears",
    car=Car(thrust=thrust),
    planted=((0.1,), (0.15,)),
)
