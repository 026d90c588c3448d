"""Different gains for a closing and an opening gap (Newell 1965; Ahmed 1999; MITSIM)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value


def act(p: Params, w: Value, seen: Seen) -> Value:
    """Return w·(1 + a) where the gap closes, w·(1 − a) where it opens, m/s.

    Example:
        >>> act((0.25,), np.array([-1.0, 1.0]), None)
        array([-1.25,  0.75])
    """
    return w - p[0] * np.abs(w)


EFFECT = Effect(
    id="asymmetric_gain",
    says="The driver responds to a closing and an opening gap with different gains: K2·(1 + a) and K2·(1 − a), a = {share}.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("share", "1", -0.95, 0.95, (0.2, -0.2), 0.15),),
    needs=("range_rate",),
    source="Newell 1965; Ahmed 1999",
    rivals=("pedal_map",),
    decides="an engine torque or acceleration signal, which shows a curved pedal map",
    range_rate=act,
    found_at=((0.3,), (-0.3,), (0.45,)),
    silent_at=((0.02,),),
)
