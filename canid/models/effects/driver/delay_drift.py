"""Dead time that changes linearly over the drive: fatigue, or two clocks that run apart."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value


def act(p: Params, seen: Seen) -> Value:
    """Return what is added to both dead times, s: 0 in the middle of the drive.

    Example:
        >>> act((0.4,), Seen(600.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0))
        0.2
    """
    return p[0] * (seen.t / seen.duration - 0.5)


EFFECT = Effect(
    id="delay_drift",
    says="The dead time changes steadily, or a clock runs off, by {rate} s over the drive.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("rate", "s", -1.5, 1.5, (0.3, -0.3), 0.3),),
    needs=(),
    source="fatigue lengthens reaction times; Chen & Ulsoy 2001",
    rivals=("clock_skew",),
    decides="the own acceleration, compared with the radar's range rate, shows whether their clocks run apart",
    dead_time=act,
    found_at=((0.8,), (1.0,)),
    found_in=10.0,
    silent_at=((0.02,),),
)


def grow(p: Params, seen: Seen) -> Value:
    """Return what is added to the dead time, s: 0 at the begin of the drive, as a wheel is turned within 0.1 s.

    Example:
        >>> grow((0.4,), Seen(300.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0))
        0.2
    """
    return p[0] * (seen.t / seen.duration)


# the same of a driver who keeps the lane
LANE = EFFECT._replace(
    # of the camera and the wheel: nothing is redundant with an offset
    decides="wheel angle and offset stamped by one clock",
    dead_time=grow,
    parameters=(Parameter("rate", "s", -1.0, 1.0, (0.2, -0.2), 0.2),),
    found_at=((0.25,), (0.3,)),
)
