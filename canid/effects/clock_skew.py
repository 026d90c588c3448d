"""The radar's clock and the car's run apart: its reports grow older, or younger, along the drive."""

from __future__ import annotations

from canid.effects.cause import Effect, Parameter, Params, Sensed


def sense(p: Params, true: Sensed) -> Sensed:
    """Return what is measured.

    Example:
        >>> sense((0.4,), Sensed(600.0, 600.0, 30.0, 0.0, 20.0, 0.0)).age
        0.4
    """
    return true._replace(age=true.age + p[0] * true.t / true.drive)


EFFECT = Effect(
    id="clock_skew",
    says="The radar's clock and the car's run apart, by {rate} s over the drive.",
    where="sensing",
    kind="redundancy",
    parameters=(Parameter("rate", "s", -3.0, 3.0, (), 0.3),),
    needs=("range_rate", "speed"),
    source="quartz clocks differ by 10 to 100 ppm; buffers that fill up by more",
    rivals=("delay_drift",),
    absorbed="a driver whose dead time drifts looks the same",
    decides="the own acceleration must show in the range rate with the same delay throughout: drive an hour",
    sense=sense,
)
