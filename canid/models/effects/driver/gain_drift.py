"""Gains that change linearly over the drive: fatigue (Pilutti & Ulsoy 1999; Chen & Ulsoy 2001: 120 parts of two hours)."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value
from canid.models.effects.operating_point import GAINS, LANE_GAINS


def act(p: Params, seen: Seen) -> Value:
    """Return the factor on both answers: 1 in the middle of the drive.

    Example:
        >>> float(act((0.4,), Seen(600.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0)))
        1.2
    """
    return 1.0 + p[0] * (seen.t / seen.duration - 0.5)


EFFECT = Effect(
    id="gain_drift",
    says="Both gains change steadily, by {rate} of their mean over the drive.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("rate", "1", -1.9, 1.9, (0.3, -0.3), 0.3),),
    needs=(),
    source="Pilutti & Ulsoy 1999; Chen & Ulsoy 2001",
    decides="a longer drive; a change away from its middle is not a drift",
    shows_desired_headway=True,
    timeless=GAINS,
    gain=act,
    found_at=((-0.6,), (0.6,)),
    silent_at=((0.03,),),
)

# the same of a driver who keeps the lane
LANE = EFFECT._replace(
    says="The gain changes steadily, by {rate} of its mean over the drive.",
    timeless=LANE_GAINS,
    found_at=((-0.7,), (0.7,)),
)
