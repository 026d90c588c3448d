"""Upper limit of the pedal: habit, a limiter, or the end of what its sensor records."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import (
    Detector,
    DriveFeatures,
    Effect,
    Kind,
    Parameter,
    Params,
    PedalDynamics,
    Share,
)
from canid.values.types import Array


def init(p: Params, first: float) -> None:
    """Start; it has no state."""


def step(p: Params, state: None, demand: float, dt: float) -> tuple[None, float]:
    """Return min(u, Pmax), %.

    Example:
        >>> step((30.0,), None, 42.0, 0.1)
        (None, 30.0)
    """
    return None, min(demand, p[0])


def column(p: Params, demand: Array, dt: float) -> Array:
    """Return the same along a drive, (n,)."""
    return np.minimum(demand, p[0])


def among_levels(drive: DriveFeatures) -> tuple[float, ...]:
    """High quantiles of the output, %."""
    return tuple(float(x) for x in np.quantile(drive.output, (0.7, 0.85, 0.94, 0.98)))


EFFECT = Effect(
    id="pedal_ceiling",
    says="The pedal is never pressed beyond {level} %, whatever the situation demands.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("level", "%", -100.0, 200.0, among_levels, 0.0, share_of=Share.TOP_PEDAL),),
    needs=(),
    source="habit, a speed or pedal limiter, or a sensor's range",
    decides="a drive that demands more pedal, or an acceleration that rises while the pedal stands there: its record ends",
    pedal=PedalDynamics(init, step, column),
    detectors=(Detector.PEDAL_CEILING,),
    found_at=((0.85,), (0.75,)),
    silent_at=((3.0,),),
)
