"""Threshold of the optical expansion rate below which there is no response (Hoffmann & Mortimer 1996: 0.003 rad/s)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Effect, Kind, Parameter, Params, Seen, Value

# m; the width of the lead, a passenger car
LEAD_WIDTH_M = 1.8


def act(p: Params, w: Value, seen: Seen) -> Value:
    """Return the relative speed beyond the threshold, m/s: the image of width W grows by w·W/g² rad/s.

    Example:
        >>> far = Seen(0.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0)
        >>> float(act((0.003,), -1.0, far)), round(float(act((0.003,), -8.0, far)), 6)
        (0.0, -2.0)
    """
    width = p[0] * seen.gap * seen.gap / LEAD_WIDTH_M
    return w - np.clip(w, -width, width)


EFFECT = Effect(
    id="looming_threshold",
    says="The driver responds to relative speed only if the lead's image grows or shrinks by more than {threshold} rad/s.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("threshold", "rad/s", 0.0, 0.012, (0.0005, 0.0015, 0.004), 0.002),),
    needs=("range_rate", "gap"),
    source="Hoffmann & Mortimer 1996; Evans & Rothery 1977",
    decides="10 min of following over a wide range of gaps, 10 to 60 m",
    range_rate=act,
    has_threshold=True,
    found_at=((0.003,), (0.005,)),
    silent_at=((0.0001,),),
)
