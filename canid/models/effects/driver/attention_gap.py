"""Attention gaps: the driver looks away and holds the pedal (Boer 2001)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.models.effects.effect import Detector, Drawn, Effect, Kind, Parameter, Params, PedalDynamics


class State(NamedTuple):
    """State of the pedal."""

    k: int  # steps so far
    coming: int  # index of the next start or stop in the parameters
    held: float | None  # %, while attention is elsewhere


def init(p: Params, first: float) -> State:
    """Start attentive; parameters: start, stop, start, stop, ... in s."""
    return State(0, 0, None)


def step(p: Params, state: State, demand: float, dt: float) -> tuple[State, float]:
    """Return the pedal: held from each start to its stop.

    Example:
        >>> state, pedal = step((0.0, 1.0), init((), 10.0), 10.0, 0.5)
        >>> state, held = step((0.0, 1.0), state, 14.0, 0.5)
        >>> pedal, held, step((0.0, 1.0), state, 14.0, 0.5)[1]
        (10.0, 10.0, 14.0)
    """
    t, k, held = state.k * dt, state.coming, state.held
    if k < len(p) and t >= p[k]:
        if t >= p[k + 1]:
            k, held = k + 2, None
        elif held is None:
            held = demand
    return State(state.k + 1, k, held), demand if held is None else held


def draw(p: Params, duration: float, rng: np.random.Generator) -> Drawn:
    """Draw episodes: a Poisson process, with durations a third to either side of the mean."""
    per_minute, mean = p
    t, out = float(rng.exponential(60 / per_minute)), []
    while t < duration:
        stop = t + mean * rng.uniform(0.67, 1.33)
        out.append((round(t, 2), round(float(stop), 2)))
        t = float(stop) + float(rng.exponential(60 / per_minute))
    return Drawn(tuple(x for episode in out for x in episode), tuple(out))


EFFECT = Effect(
    id="attention_gap",
    says="The driver holds the pedal for {duration} s at a time, {per_minute} times per minute: attention is elsewhere.",
    where="driver",
    kind=Kind.EPISODES,
    parameters=(
        Parameter("per_minute", "1/min", 0.0, 20.0, (), 1.0),
        Parameter("duration", "s", 1.0, 10.0, (), 3.0),
    ),
    needs=(),
    source="Boer 2001; glances off the road: Klauer et al. 2006",
    decides="10 min of following behind a lead whose speed changes",
    pedal=PedalDynamics(init, step),
    detectors=(Detector.PEDAL_HOLDS,),
    draw=draw,
    found_at=((1.0, 3.0), (1.5, 4.0)),
    silent_at=((0.5, 0.3),),
)

# the same of a driver who keeps the lane
LANE = EFFECT._replace(
    says="The driver holds the wheel for {duration} s at a time, {per_minute} times per minute: attention is elsewhere.",
    decides="10 min on a road on which wind or the surface moves the car",
    found_at=((2.0, 2.0), (1.5, 2.5)),
)
