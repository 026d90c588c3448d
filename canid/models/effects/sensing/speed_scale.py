"""Scale error of the car's own speed signal: worn or other tyres."""

from __future__ import annotations

from collections.abc import Mapping

from canid.models.effects.effect import Effect, Kind, Parameter, Params, SensorValues
from canid.models.effects.redundancy import Redundancy, Relation, excess
from canid.values.types import Array


def sense(p: Params, true: SensorValues) -> SensorValues:
    """Return what is measured.

    Example:
        >>> sense((0.02,), SensorValues(0.0, 600.0, 30.0, 0.0, 20.0, 0.0)).speed
        20.4
    """
    return true._replace(speed=true.speed * (1 + p[0]))


def correct(p: Params, signals: Mapping[str, Array]) -> dict[str, Array]:
    """Divide by the scale."""
    return {"speed": signals["speed"] / (1 + p[0])}


EFFECT = Effect(
    id="speed_scale",
    says="The car's own speed signal is wrong by a share of {share}.",
    where="sensing",
    kind=Kind.REDUNDANCY,
    parameters=(Parameter("share", "1", -0.2, 0.2, (), 0.02),),
    needs=("speed", "gnss_speed"),
    source="wheel radius: 1 to 4 % between new, worn and other tyres",
    absorbed="gains, headway and offset take it up",
    decides="the speed by GNSS: map `gnss_speed`",
    sense=sense,
    redundancy=Redundancy(Relation.SPEED, excess(Relation.SPEED, 1.0)),
    correct=correct,
    findings=("speed_scale", "speed_unit"),
    found_at=((0.03,), (-0.04,)),
    silent_at=((0.001,),),
)
