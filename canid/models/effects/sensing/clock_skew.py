"""Clock skew between radar and car: the radar's reports grow older, or younger, along the drive."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, SensorValues
from canid.models.effects.redundancy import Redundancy, Relation, excess


def sense(p: Params, true: SensorValues) -> SensorValues:
    """Return what is measured.

    Example:
        >>> sense((0.4,), SensorValues(600.0, 600.0, 30.0, 0.0, 20.0, 0.0)).age
        0.4
    """
    return true._replace(age=true.age + p[0] * true.t / true.duration)


EFFECT = Effect(
    id="clock_skew",
    says="The clocks of the radar or camera and of the car drift apart by {rate} s over the drive.",
    where="sensing",
    kind=Kind.REDUNDANCY,
    parameters=(Parameter("rate", "s", -3.0, 3.0, (), 0.3),),
    needs=("range_rate", "speed"),
    source="quartz clocks differ by 10 to 100 ppm; buffers that fill up by more",
    rivals=("delay_drift",),
    absorbed="a drifting dead time of the driver has the same effect",
    decides="the own acceleration shows in the range rate with the same delay throughout, or not: drive an hour",
    sense=sense,
    redundancy=Redundancy(Relation.RADAR_AGE_DRIFT, excess(Relation.RADAR_AGE_DRIFT, 0.0)),
    # no `found_at`: an hour of driving decides, longer than any test
    silent_at=((0.03,),),
)
