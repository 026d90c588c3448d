"""The engine gives no more than its power: the force falls with speed, whatever the pedal says."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Car, CarSeen, Effect, Parameter, Params, Value


def thrust(p: Params, drive: Value, seen: CarSeen) -> Value:
    """Return the drive that the power allows, %: Kp·D·v ≤ power.

    Example:
        >>> seen = CarSeen(0.0, 30.0, np.array([10.0, 30.0]), 0.0, 4.0, 30.0, 0.04)
        >>> thrust((18.0,), 30.0, seen).tolist()
        [30.0, 15.0]
    """
    return np.minimum(drive, p[0] / (np.maximum(seen.strength, 1e-3) * np.maximum(seen.speed, 1.0)))


EFFECT = Effect(
    id="power_limit",
    says="The engine gives no more than {power} W per kg.",
    where="vehicle",
    kind="curve",
    parameters=(Parameter("power", "W/kg", 1.0, 200.0, (), 15.0),),
    needs=("pedal", "speed"),
    source="force = power / speed",
    decides="full pedal at high speed",
    car=Car(thrust=thrust),
    planted=(),
)
