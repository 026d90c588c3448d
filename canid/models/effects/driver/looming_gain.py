"""Response to relative speed that falls with the gap (Gazis, Herman & Rothery 1961)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value

# m; the gap that K2 refers to
REFERENCE_GAP_M = 30.0
# m; nobody follows closer, and a power of 0 is infinite
MIN_GAP_M = 2.0


def act(p: Params, w: Value, seen: Seen) -> Value:
    """Return w·(g0/g)^m, m/s.

    Example:
        >>> float(act((1.0,), -1.0, Seen(0.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0)))
        -0.5
    """
    return w * (REFERENCE_GAP_M / np.maximum(seen.gap, MIN_GAP_M)) ** p[0]


EFFECT = Effect(
    id="looming_gain",
    says="The driver responds to relative speed more strongly the closer the lead is: K2·(30 m/gap)^{exponent}.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("exponent", "1", -1.5, 3.0, (0.3, 1.0), 0.3),),
    needs=("range_rate", "gap"),
    source="Gazis, Herman & Rothery 1961",
    decides="10 min of following over a wide range of gaps, 10 to 60 m",
    range_rate=act,
    found_at=((0.8,), (1.2,)),
    silent_at=((0.03,),),
)
