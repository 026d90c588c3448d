"""Steady wind from ahead or behind: the air passes faster, or slower, than the road."""

from __future__ import annotations

from canid.effects.cause import Car, CarSeen, Effect, Parameter, Params, Value

# 1/m; drag of a middle-class car, cd·A·ρ / (2 m) = 0.68 m² · 1.2 kg/m³ / (2 · 1500 kg)
DRAG = 2.7e-4


def push(p: Params, seen: CarSeen) -> Value:
    """Return what the wind adds to the drag of still air, m/s².

    Example:
        >>> round(push((5.0,), CarSeen(0.0, 10.0, 20.0, 0.0, 4.0, 10.0, 0.04)), 3)
        -0.061
    """
    return -DRAG * (2 * seen.speed * p[0] + p[0] * p[0])


EFFECT = Effect(
    id="headwind",
    says="A steady wind of {speed} m/s blows from ahead (below 0: from behind).",
    where="vehicle",
    kind="curve",
    parameters=(Parameter("speed", "m/s", -20.0, 20.0, (5.0, -5.0), 5.0),),
    needs=("speed",),
    source="drag goes with the square of the air's speed",
    rivals=("road_grade",),
    absorbed="rolling resistance and drag take up all but a hundredth of it, as they do a viscous drag",
    decides="the same road in both directions",
    car=Car(push=push),
)
