"""Backlash (play): the pedal moves only after the demand has moved by its width."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, PedalDynamics


def init(p: Params, first: float) -> float:
    """Start in the middle of the play."""
    return first


def step(p: Params, state: float, demand: float, dt: float) -> tuple[float, float]:
    """Return the pedal behind a play of width b, %.

    Example:
        >>> step((2.0,), 10.0, 10.5, 0.1)[1], step((2.0,), 10.0, 12.5, 0.1)[1]
        (10.0, 11.5)
    """
    half = 0.5 * p[0]
    y = min(max(state, demand - half), demand + half)
    return y, y


EFFECT = Effect(
    id="backlash",
    says="The output follows the demand with a backlash of {width} %.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("width", "%", 0.0, 30.0, (2.0, 6.0), 3.0),),
    needs=(),
    source="play of pedal and linkage; stiction of a resting foot",
    absorbed="the driver's own noise passes through the play and fills it; what is left is a dead time",
    decides="30 min of following with little pedal noise",
    identifiable=False,
    pedal=PedalDynamics(init, step),
    silent_at=((0.3,),),
)
