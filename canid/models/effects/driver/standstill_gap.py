"""Standstill distance: desired gap = s0 + THW_des·v (IDM: Treiber, Hennecke & Helbing 2000)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value

# m/s; below it a headway is not meaningful
MIN_SPEED = 2.0


def act(p: Params, e: Value, seen: Seen) -> Value:
    """Return the headway error against THW_des + s0/v, s.

    Example:
        >>> float(act((4.0,), 0.0, Seen(0.0, 600.0, 2.0, -1.0, 60.0, 8.0, 0.0)))
        -0.5
    """
    return e - p[0] / np.maximum(seen.speed, MIN_SPEED)


EFFECT = Effect(
    id="standstill_gap",
    says="The driver keeps {distance} m in addition to the time headway.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("distance", "m", -12.0, 20.0, (3.0,), 4.0),),
    needs=("gap", "speed"),
    source="Treiber, Hennecke & Helbing 2000 (IDM)",
    rivals=("range_offset",),
    decides="a second range sensor, or a stop close behind the lead",
    wanted_gap=True,
    headway=act,
    found_at=((5.0,), (8.0,)),
    silent_at=((0.1,),),
)
