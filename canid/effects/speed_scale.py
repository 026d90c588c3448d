"""The own speed is wrong by a fixed share: worn or other tyres."""

from __future__ import annotations

from canid.effects.cause import Effect, Parameter, Params, Sensed


def sense(p: Params, true: Sensed) -> Sensed:
    """Return what is measured.

    Example:
        >>> sense((0.02,), Sensed(0.0, 600.0, 30.0, 0.0, 20.0, 0.0)).speed
        20.4
    """
    return true._replace(speed=true.speed * (1 + p[0]))


EFFECT = Effect(
    id="speed_scale",
    says="The own speed is measured wrongly by a share of {share}.",
    where="sensing",
    kind="redundancy",
    parameters=(Parameter("share", "1", -0.2, 0.2, (), 0.02),),
    needs=("speed", "gnss_speed"),
    source="wheel radius: 1 to 4 % between new, worn and other tyres",
    absorbed="gains, headway and offset take it up",
    decides="the speed by satellite: map gnss_speed",
    sense=sense,
)
