"""Constant latency of the radar's reports: processing and buffering."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, SensorValues
from canid.models.effects.redundancy import Redundancy, Relation, excess


def sense(p: Params, true: SensorValues) -> SensorValues:
    """Return what is measured.

    Example:
        >>> sense((0.1,), SensorValues(0.0, 600.0, 30.0, 0.0, 20.0, 0.0)).age
        0.1
    """
    return true._replace(age=true.age + p[0])


EFFECT = Effect(
    id="radar_latency",
    says="The radar's reports are {delay} s older than the car's own speed signal.",
    where="sensing",
    kind=Kind.REDUNDANCY,
    judges=("radar_latency",),
    parameters=(Parameter("delay", "s", 0.0, 1.0, (), 0.15),),
    needs=("range_rate", "speed"),
    source="latencies of 50 to 300 ms; the own motion shows in the range rate at once, or late by this",
    absorbed="the driver's dead time takes it up",
    decides="an hour of driving, or a radar with little noise: own acceleration shows in the range rate at once, or late",
    sense=sense,
    redundancy=Redundancy(Relation.RADAR_AGE, excess(Relation.RADAR_AGE, 0.0)),
    # no `correct`: a late radar stays late, and the driver's dead time takes that up, as the finding says
    found_in=15.0,
    found_at=((0.35,), (0.45,)),
    silent_at=((0.02,),),
)
