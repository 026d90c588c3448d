"""Constant offset of the measured gap: the radar sits behind the bumper, or measures to the wheels."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, SensorValues
from canid.models.effects.redundancy import Redundancy


def sense(p: Params, true: SensorValues) -> SensorValues:
    """Return what is measured.

    Example:
        >>> sense((1.5,), SensorValues(0.0, 600.0, 30.0, 0.0, 20.0, 0.0)).gap
        31.5
    """
    return true._replace(gap=true.gap + p[0])


EFFECT = Effect(
    id="range_offset",
    says="The measured gap is off by {distance} m.",
    where="sensing",
    kind=Kind.REDUNDANCY,
    parameters=(Parameter("distance", "m", -5.0, 5.0, (), 1.5),),
    needs=("gap",),
    source="radar mounting, 0.5 to 3 m",
    rivals=("standstill_gap",),
    absorbed="a constant offset of the gap and a driver who keeps that distance give the same drive",
    decides="a second range sensor, or a stop close behind the lead",
    sense=sense,
    identifiable=False,
    redundancy=Redundancy(None),
    silent_at=((0.3,),),
)
