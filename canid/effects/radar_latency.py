"""The radar's reports are older than they seem, by the same time throughout: processing and buffering."""

from __future__ import annotations

from canid.effects.cause import Effect, Parameter, Params, Sensed


def sense(p: Params, true: Sensed) -> Sensed:
    """Return what is measured.

    Example:
        >>> sense((0.1,), Sensed(0.0, 600.0, 30.0, 0.0, 20.0, 0.0)).age
        0.1
    """
    return true._replace(age=true.age + p[0])


EFFECT = Effect(
    id="radar_latency",
    says="The radar's reports are {delay} s older than the own speed's.",
    where="sensing",
    kind="redundancy",
    parameters=(Parameter("delay", "s", 0.0, 1.0, (), 0.15),),
    needs=("range_rate", "speed"),
    source="radars of 50 to 300 ms; the own motion is in the range rate at once, or late by this",
    absorbed="the driver's dead time takes it up",
    decides="an hour of driving, or a radar with little noise: the own acceleration must show in the range rate at once",
    sense=sense,
)
