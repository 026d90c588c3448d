"""The answer to relative speed falls with the gap (Gazis, Herman & Rothery 1961)."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Effect, Parameter, Params, Seen, Value

# m; the gap at which K2 is told
GAP = 30.0
# m; nobody follows nearer, and a power of nothing is endless
NEAREST = 2.0


def act(p: Params, w: Value, seen: Seen) -> Value:
    """Return w·(g0/g)^m, m/s.

    Example:
        >>> float(act((1.0,), -1.0, Seen(0.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0)))
        -0.5
    """
    return w * (GAP / np.maximum(seen.gap, NEAREST)) ** p[0]


EFFECT = Effect(
    id="looming_gain",
    says="The driver answers relative speed more the nearer the lead is: K2·(30 m/gap)^{exponent}.",
    where="driver",
    kind="curve",
    parameters=(Parameter("exponent", "1", -1.5, 3.0, (0.3, 1.0), 0.3),),
    needs=("range_rate", "gap"),
    source="Gazis, Herman & Rothery 1961",
    decides="10 min of following over a wide range of gaps, 10 to 60 m",
    range_rate=act,
    planted=((0.8,), (1.2,)),
)
