"""The headway that the driver wants wanders (seen in real platoons, data/openacc)."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Effect, Parameter, Params, Seen, Value

# knots per s at which the wish may have changed: people change it within minutes, not seconds
EVERY = 30.0


def act(p: Params, e: Value, seen: Seen) -> Value:
    """Return the headway error against the wish of that moment, s.

    Args:
        p: the wish's deviation from its mean, s, at knots `EVERY` s apart from 0 on.
        e: headway error, s.
        seen: when.

    Example:
        >>> float(act((0.0, 0.3), -0.1, Seen(15.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0)))
        -0.25
    """
    if not len(p):
        return e
    return e - np.interp(seen.t, EVERY * np.arange(len(p)), np.asarray(p, dtype=np.float64))


EFFECT = Effect(
    id="headway_drift",
    says="The headway that the driver wants wanders, with a standard deviation of {sd} s over the drive.",
    where="driver",
    kind="wander",
    parameters=(Parameter("sd", "s", 0.0, 2.0, (), 0.25),),
    needs=("gap", "speed"),
    source="data/openacc: a fixed one makes the simulation of the other half worse than its mean",
    decides="a drive of 20 min or more",
    headway=act,
    planted=((0.4,), (0.6,)),
)
