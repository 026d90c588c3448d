"""Sinusoidal pedal movement: a line in the spectrum, as of a secondary task with a rhythm."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import Detector, Effect, Kind, Parameter, Params, PedalDynamics
from canid.values.types import Array


def init(p: Params, first: float) -> float:
    """Start; the state is the time since the drive's first sample, s."""
    return 0.0


def step(p: Params, t: float, demand: float, dt: float) -> tuple[float, float]:
    """Add A sin(2πft + φ) to the pedal.

    Example:
        >>> round(step((2.0, 0.25, 0.0), 1.0, 10.0, 0.1)[1], 6)
        12.0
    """
    return t + dt, demand + float(p[0] * np.sin(2 * np.pi * p[1] * t + (p[2] if len(p) > 2 else 0.0)))


def column(p: Params, demand: Array, dt: float) -> Array:
    """Return the same over a drive, (n,).

    Example:
        >>> column((2.0, 2.5, 0.0), np.full(3, 10.0), 0.1).round(6)
        array([10., 12., 10.])
    """
    out: Array = demand + p[0] * np.sin(2 * np.pi * p[1] * dt * np.arange(demand.size) + p[2])
    return out


EFFECT = Effect(
    id="periodic_task",
    says="The output oscillates by {amplitude} % at {frequency} Hz, whatever the lead does.",
    where="driver",
    kind=Kind.LINE,
    parameters=(
        Parameter("amplitude", "%", 0.0, 20.0, (), 2.0),
        Parameter("frequency", "Hz", 0.02, 2.0, (), 0.1),
        Parameter("phase", "rad", -np.pi, np.pi, (), 0.0),
    ),
    needs=(),
    source="glances and secondary tasks with a rhythm: Klauer et al. 2006",
    decides="10 min of following",
    pedal=PedalDynamics(init, step, column),
    detectors=(Detector.SPECTRAL_LINE,),
    found_at=((2.5, 0.12, 0.0), (3.0, 0.2, 1.0)),
    silent_at=((0.05, 0.12, 0.0),),
)
