"""Curved pedal map: the first per cents of travel give more, or less, than the last ones."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Value, VehicleHooks, more_than

NEUTRAL_PERCENT = 20.0  # where a curved map gives what a straight one gives


def pedal(p: Params, pressed: Value) -> Value:
    """Return the pedal after the map, %.

    Example:
        >>> pedal((0.5,), 10.0), pedal((0.5,), 40.0)
        (7.5, 60.0)
    """
    return pressed + p[0] * pressed * (pressed / NEUTRAL_PERCENT - 1)


EFFECT = Effect(
    id="pedal_map",
    says="The pedal map is curved, by {curvature} of its slope at 20 %.",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("curvature", "1", -0.8, 2.0, (0.3, -0.3), 0.3),),
    needs=("pedal",),
    source="progressive and degressive accelerator maps",
    decides="driving over the whole range of the pedal",
    vehicle=VehicleHooks(pedal=pedal),
    unusual=more_than(0.1),  # maps are curved by some per cent
    found_at=((0.5,), (0.6,)),
    silent_at=((0.03,),),
)
