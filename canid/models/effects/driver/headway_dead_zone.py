"""Dead zone of the headway error: complacency (Todosiev 1963; Chen & Ulsoy 2001, reference 18)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value


def act(p: Params, e: Value, seen: Seen) -> Value:
    """Return the headway error beyond the zone, s.

    Example:
        >>> act((0.25,), np.array([-1.0, 0.1, 0.5]), None)
        array([-0.75,  0.  ,  0.25])
    """
    return e - np.clip(e, -p[0], p[0])


EFFECT = Effect(
    id="headway_dead_zone",
    says="The driver does not respond while the headway is within ±{width} s of the desired one.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("width", "s", 0.0, 1.5, (0.08, 0.16, 0.3, 0.5, 0.8), 0.3),),
    needs=("gap", "speed"),
    source="Todosiev 1963; complacency in Chen & Ulsoy 2001 [18]",
    decides="10 min of urban following, where the headway moves most",
    shows_desired_headway=True,
    headway=act,
    has_threshold=True,
    found_in=15.0,
    found_at=((0.4,), (0.6,)),
    silent_at=((0.02,),),
)
