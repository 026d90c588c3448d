"""Response to headway that grows with speed (Grover 2021, eq. 2.1; not in the transfer function)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value

# m/s; the speed that K1 refers to
REFERENCE_SPEED = 20.0
MIN_SPEED = 2.0  # m/s; below it a headway is not meaningful


def act(p: Params, e: Value, seen: Seen) -> Value:
    """Return e·(v/v0)^m, s.

    Example:
        >>> float(act((1.0,), -0.5, Seen(0.0, 600.0, 2.0, -1.0, 60.0, 10.0, 0.0)))
        -0.25
    """
    return e * (np.maximum(seen.speed, MIN_SPEED) / REFERENCE_SPEED) ** p[0]


EFFECT = Effect(
    id="speed_gain",
    says="The driver responds to headway more strongly at high speed: K1·(speed/20 m/s)^{exponent}; 1: response to the gap.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("exponent", "1", -2.0, 3.0, (0.4, 1.0), 0.6),),
    needs=("gap", "speed"),
    source="Grover 2021, eq. 2.1",
    decides="10 min of following at town and motorway speeds",
    shows_desired_headway=True,
    wanted_gap=True,
    headway=act,
    found_at=((1.0,), (1.5,)),
    silent_at=((0.03,),),
)
