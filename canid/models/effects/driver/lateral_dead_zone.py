"""Dead zone of the lateral offset: complacency (Chen & Ulsoy 2000, reference 18 of their paper of 2001)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, LaneHooks, Parameter, Params, Value


def act(p: Params, y: Value) -> Value:
    """Return the offset beyond the zone, m.

    Example:
        >>> act((0.25,), np.array([-1.0, 0.125, 0.5]))
        array([-0.75,  0.  ,  0.25])
    """
    return y - np.clip(y, -p[0], p[0])


EFFECT = Effect(
    id="lateral_dead_zone",
    says="The driver does not respond within {width} m of the wanted position.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("width", "m", 0.0, 1.5, (0.05, 0.1, 0.15, 0.2, 0.26, 0.33, 0.42, 0.55), 0.2),),
    needs=("lateral_offset",),
    source="Chen & Ulsoy 2000",
    decides="10 min on a road on which wind or the surface moves the car",
    shows_desired_headway=True,
    lane=LaneHooks(offset=act),
    found_at=((0.2,), (0.35,)),
    silent_at=((0.01,),),
)
