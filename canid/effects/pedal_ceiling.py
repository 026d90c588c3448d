"""The pedal goes no further than a level: habit, or a limiter."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Effect, Foot, Parameter, Params
from canid.types import Array


def init(p: Params, first: float) -> None:
    """It has no memory."""


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


EFFECT = Effect(
    id="pedal_ceiling",
    says="The pedal is never pressed beyond {level} %, whatever the situation asks for.",
    where="driver",
    kind="curve",
    parameters=(Parameter("level", "%", -100.0, 200.0, (), 0.0),),
    needs=(),
    source="habit, or a speed or pedal limiter",
    decides="a drive that asks for more pedal",
    foot=Foot(init, step, column),
    planted=((0.85,), (0.75,)),
)
