"""Desired headway that follows a random walk (variance component: Harville 1977)."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import (
    KNOT_SPACING_S,
    Detector,
    Drawn,
    Effect,
    Kind,
    Parameter,
    Params,
    Seen,
    Value,
)


def act(p: Params, e: Value, seen: Seen) -> Value:
    """Return the headway error from the desired headway at that time, s.

    Args:
        p: deviation of the desired headway from its mean, s, at knots `KNOT_SPACING_S` s apart from 0 on.
        e: headway error, s.
        seen: when.

    Example:
        >>> float(act((0.0, 0.3), -0.1, Seen(15.0, 600.0, 2.0, -1.0, 60.0, 30.0, 0.0)))
        -0.25
    """
    if not len(p):
        return e
    return e - np.interp(seen.t, KNOT_SPACING_S * np.arange(len(p)), np.asarray(p, dtype=np.float64))


def draw(p: Params, duration: float, rng: np.random.Generator) -> Drawn:
    """Draw the knots of one random walk, with the standard deviation `p[0]` over the drive."""
    knots = np.cumsum(rng.standard_normal(int(duration / KNOT_SPACING_S) + 2))
    knots -= knots.mean()
    return Drawn(tuple((p[0] * knots / max(float(np.std(knots)), 1e-9)).tolist()))


EFFECT = Effect(
    id="headway_drift",
    says="The desired headway follows a random walk, with a standard deviation of {sd} s over the drive.",
    where="driver",
    kind=Kind.RANDOM_WALK,
    parameters=(Parameter("sd", "s", 0.0, 2.0, (), 0.25),),
    needs=("gap", "speed"),
    source="OpenACC platoons (Makridis et al. 2021): fitted to one half of a drive, a fixed one makes the other half worse",
    decides="a drive of 20 min or more",
    headway=act,
    detectors=(Detector.RANDOM_WALK,),
    draw=draw,
    found_at=((0.4,), (0.6,)),
    silent_at=((0.02,),),
)
