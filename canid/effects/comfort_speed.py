"""Above a speed that he likes the driver lifts his foot, whatever the lead does (IDM's v0)."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Effect, Parameter, Params, Seen, Value


def act(p: Params, seen: Seen) -> Value:
    """Return −k·max(v − v_c, 0), %.

    Example:
        >>> float(act((2.0, 30.0), Seen(0.0, 600.0, 2.0, -1.0, 60.0, 33.0, 0.0)))
        -6.0
    """
    return -p[0] * np.maximum(seen.speed - p[1], 0.0)


EFFECT = Effect(
    id="comfort_speed",
    says="Above {speed} m/s the driver lifts his foot by {gain} % per m/s.",
    where="driver",
    kind="curve",
    # a wish to go faster the faster one goes is nobody's
    parameters=(
        Parameter("gain", "%/(m/s)", 0.0, 15.0, (1.0,), 1.5),
        Parameter("speed", "m/s", 2.0, 60.0, (), 0.0),
    ),
    needs=("speed",),
    source="Treiber, Hennecke & Helbing 2000 (IDM: v0)",
    decides="10 min of following below and above the speed in question",
    extra=act,
    planted=((3.0, 0.7), (5.0, 0.6)),
)
