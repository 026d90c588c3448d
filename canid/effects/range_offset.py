"""The radar's gap is too long or too short by a fixed distance: it measures from behind the bumper, or to the wheels."""

from __future__ import annotations

from canid.effects.cause import Effect, Parameter, Params, Sensed


def sense(p: Params, true: Sensed) -> Sensed:
    """Return what is measured.

    Example:
        >>> sense((1.5,), Sensed(0.0, 600.0, 30.0, 0.0, 20.0, 0.0)).gap
        31.5
    """
    return true._replace(gap=true.gap + p[0])


EFFECT = Effect(
    id="range_offset",
    says="The measured gap is off by {distance} m.",
    where="sensing",
    kind="redundancy",
    parameters=(Parameter("distance", "m", -5.0, 5.0, (), 1.5),),
    needs=("gap",),
    source="radar mounting; reference range .5 to 3 m",
    rivals=("standstill_gap",),
    absorbed="a fixed distance on the gap and a driver who keeps that distance look the same",
    decides="a second range sensor, or a stop close behind the lead",
    sense=sense,
)
