"""Steady wind from ahead or behind: it adds to the speed in the drag."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Value, VehicleHooks, VehicleState
from canid.models.effects.vehicle.slope import unmeasured_slope

# 1/m; drag of a mid-size car, cd·A·ρ / (2 m) = 0.68 m² · 1.2 kg/m³ / (2 · 1500 kg)
DRAG = 2.7e-4


def push(p: Params, state: VehicleState) -> Value:
    """Return what the wind adds to the acceleration, m/s²: the drag above that of still air.

    Example:
        >>> round(push((5.0,), VehicleState(0.0, 10.0, 20.0, 0.0, 4.0, 10.0, 0.04)), 3)
        -0.061
    """
    return -DRAG * (2 * state.speed * p[0] + p[0] * p[0])


EFFECT = Effect(
    id="headwind",
    says="A steady wind of {speed} m/s blows from ahead (below 0: from behind).",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("speed", "m/s", -20.0, 20.0, (5.0, -5.0), 5.0),),
    needs=("speed",),
    source="drag is proportional to the square of the speed through the air",
    rivals=("road_grade",),
    absorbed="rolling resistance and drag take up all but a hundredth of it",
    decides="the same road in both directions",
    identifiable=False,
    unavailable=unmeasured_slope,
    vehicle=VehicleHooks(push=push),
    silent_at=((2.0,),),
)
