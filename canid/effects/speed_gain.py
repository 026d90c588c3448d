"""The answer to headway grows with speed: Grover's eq. 2.1, which his transfer function drops."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Effect, Parameter, Params, Seen, Value

# m/s; the speed at which K1 is told
SPEED = 20.0
SLOWEST = 2.0  # m/s; below it a headway means nothing


def act(p: Params, e: Value, seen: Seen) -> Value:
    """Return e·(v/v0)^m, s.

    Example:
        >>> float(act((1.0,), -0.5, Seen(0.0, 600.0, 2.0, -1.0, 60.0, 10.0, 0.0)))
        -0.25
    """
    return e * (np.maximum(seen.speed, SLOWEST) / SPEED) ** p[0]


EFFECT = Effect(
    id="speed_gain",
    says="The driver answers headway more the faster he drives: K1·(speed/20 m/s)^{exponent}; 1 is a gap error.",
    where="driver",
    kind="curve",
    parameters=(Parameter("exponent", "1", -2.0, 3.0, (0.4, 1.0), 0.6),),
    needs=("gap", "speed"),
    source="Grover 2021, eq. 2.1",
    decides="10 min of following at town and motorway speeds",
    centred=True,
    headway=act,
    planted=((1.0,), (1.5,)),
)
