"""Intermittent control: decisions at intervals, the pedal held in between (Gawthrop 2011; Wagner 2006; Markkula 2018)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from canid.models.effects.effect import Detector, Effect, Kind, Parameter, Params, PedalDynamics
from canid.values.types import Array


class State(NamedTuple):
    """State of the pedal between two decisions."""

    start: float  # %, at the last decision
    decided: float  # %
    left: float  # s until the next decision


def moved(since: Any, release: float) -> Any:
    """Minimum-jerk movement: part of the way that is done, 0 to 1 (Flash & Hogan 1985, eq. 1).

    Example:
        >>> moved(np.array([0.0, 0.1, 0.3]), 0.2)
        array([0. , 0.5, 1. ])
    """
    u = np.minimum(since / release, 1.0) if release > 1e-4 else np.ones_like(since)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


def init(p: Params, first: float) -> State:
    """Start at rest; parameters: interval (s), phase (s until the first decision), duration of a movement (s)."""
    return State(first, first, p[1] if len(p) > 1 else p[0])


def step(p: Params, state: State, demand: float, dt: float) -> tuple[State, float]:
    """Hold the demand for one interval, then move to the new one.

    Example:
        >>> state, pedal = step((1.0, 0.0, 0.0), State(10.0, 10.0, 0.5), 14.0, 0.1)
        >>> pedal, step((1.0, 0.0, 0.0), State(10.0, 10.0, 0.05), 14.0, 0.1)[1]
        (10.0, 14.0)
    """
    start, decided, left = state.start, state.decided, state.left - dt
    release = p[2] if len(p) > 2 else 0.0
    if left <= 1e-9:
        # a decision that comes between two steps of the grid keeps its own rhythm
        start, decided, left = decided, demand, left + p[0]
    pedal = start + (decided - start) * float(moved(np.float64(p[0] - left), release))
    return State(start, decided, left), pedal


def column(p: Params, demand: Array, dt: float) -> Array:
    """Return the pedal (n,); decisions may lie between samples.

    Example:
        >>> column((0.3, 0.1, 0.0), np.arange(6.0), 0.1)
        array([0., 1., 1., 1., 4., 4.])
    """
    t = dt * np.arange(demand.size)
    at = p[1] + p[0] * np.floor((t - p[1]) / p[0] + 1e-9)
    decided, start = np.interp(at, t, demand), np.interp(at - p[0], t, demand)
    out: Array = start + (decided - start) * moved(t - at, float(p[2]))
    return out


EFFECT = Effect(
    id="act_and_wait",
    says="The driver decides every {interval} s and holds the pedal in between.",
    where="driver",
    kind=Kind.EPISODES,
    parameters=(
        Parameter("interval", "s", 0.3, 4.0, (), 1.0, fixed=True),
        Parameter("phase", "s", 0.0, 4.0, (), 0.0, fixed=True),
        Parameter("release", "s", 0.0, 1.0, (), 0.2),
    ),
    needs=(),
    source="Gawthrop et al. 2011; Wagner 2006; Markkula et al. 2018",
    decides="10 min of following with little pedal noise",
    pedal=PedalDynamics(init, step, column),
    detectors=(Detector.PEDAL_RHYTHM, Detector.INTERMITTENT_CONTROL),
    intermittent=True,
    found_at=((1.5, 0.0, 0.1), (2.5, 1.0, 0.2)),
    silent_at=((0.3, 0.0, 0.2),),
)
