"""The road rises and falls: the weight pulls along it."""

from __future__ import annotations

from canid.effects.cause import GRAVITY, Car, CarSeen, Effect, Parameter, Params, Value


def push(p: Params, seen: CarSeen) -> Value:
    """Return what the slope does, m/s².

    Example:
        >>> round(push((2.0,), CarSeen(0.0, 10.0, 20.0, 1.0, 4.0, 10.0, 0.04)), 4)
        -0.1962
    """
    return -GRAVITY / 100 * p[0] * seen.slope


EFFECT = Effect(
    id="road_grade",
    says="The road rises and falls, with a standard deviation of {sd} %.",
    where="vehicle",
    kind="curve",
    parameters=(Parameter("sd", "%", 0.0, 15.0, (1.0,), 1.0),),
    needs=("grade",),
    source="weight along the slope, 0.098 m/s² per %",
    rivals=(),
    absorbed="a constant slope is part of the rolling resistance",
    decides="map grade or altitude",
    car=Car(push=push),
    planted=((2.0,), (2.5,)),
)
