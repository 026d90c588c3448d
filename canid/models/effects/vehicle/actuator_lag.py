"""A second lag between pedal and engine force."""

from __future__ import annotations

from canid.models.effects.effect import (
    Effect,
    Kind,
    Parameter,
    Params,
    Value,
    VehicleHooks,
    VehicleState,
    more_than,
)


def lag(p: Params, state: VehicleState) -> Value:
    """Return the further lag, s.

    Example:
        >>> lag((0.2,), None)
        0.2
    """
    return p[0]


EFFECT = Effect(
    id="actuator_lag",
    says="A second lag of {tau} s lies between the pedal and the engine's force.",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("tau", "s", 0.0, 3.0, (0.2,), 0.2),),
    needs=("pedal",),
    source="throttle actuator, gearbox, driveline",
    rivals=("turbo_lag",),  # at loads that never spin the charger up its lag is constant
    absorbed="of two lags in series it is not identifiable which is the engine's: only more than any car has is named",
    decides="quick steps of the pedal, from low and from high load",
    vehicle=VehicleHooks(lag=lag),
    unusual=more_than(0.12),  # s; intake and driveline are a second lag of 0.1 s
    found_at=((0.6,), (0.8,)),
    silent_at=((0.05,),),
)
