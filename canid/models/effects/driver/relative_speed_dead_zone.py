"""Dead zone of the relative speed (Wiedemann 1974; Pariota & Bifulco 2015)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value


def act(p: Params, w: Value, seen: Seen) -> Value:
    """Return the relative speed beyond the zone, m/s.

    Example:
        >>> act((0.5,), np.array([-2.0, 0.1, 0.75]), None)
        array([-1.5 ,  0.  ,  0.25])
    """
    return w - np.clip(w, -p[0], p[0])


EFFECT = Effect(
    id="relative_speed_dead_zone",
    says="The driver does not respond to relative speeds below {width} m/s.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("width", "m/s", 0.0, 3.0, (0.3, 0.8, 1.4), 0.5),),
    needs=("range_rate",),
    source="Wiedemann 1974; Pariota & Bifulco 2015",
    decides="10 min behind a lead whose speed changes often and little",
    range_rate=act,
    has_threshold=True,
    in_demo=True,
    found_at=((0.6,), (1.0,)),
    silent_at=((0.03,),),
)
