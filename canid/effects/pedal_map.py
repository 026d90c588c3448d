"""The pedal's map is bent: the first per cents do more, or less, than the last."""

from __future__ import annotations

from canid.effects.cause import Car, Effect, Parameter, Params, Value

NEUTRAL = 20.0  # %; where a bent map gives what a straight one gives


def pedal(p: Params, pressed: Value) -> Value:
    """Return the pedal that the engine acts on, %.

    Example:
        >>> pedal((0.5,), 10.0), pedal((0.5,), 40.0)
        (7.5, 60.0)
    """
    return pressed + p[0] * pressed * (pressed / NEUTRAL - 1)


EFFECT = Effect(
    id="pedal_map",
    says="The pedal's map is bent: by a curvature of {curvature} (of its slope at 20 %).",
    where="vehicle",
    kind="curve",
    parameters=(Parameter("curvature", "1", -0.8, 2.0, (0.3, -0.3), 0.3),),
    needs=("pedal",),
    source="progressive and degressive accelerator maps",
    decides="the whole of the pedal's range",
    car=Car(pedal=pedal),
    planted=((0.4,), (0.6,)),
)
