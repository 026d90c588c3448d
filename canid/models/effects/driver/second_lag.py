"""Second, neuromuscular lag (McRuer & Jex 1967): below 0.5 Hz it is the same as a dead time."""

from __future__ import annotations

import math

from scipy.signal import lfilter

from canid.models.effects.effect import Effect, Kind, Parameter, Params, PedalDynamics
from canid.values.types import Array


def init(p: Params, first: float) -> float:
    """Start at rest."""
    return first


def step(p: Params, state: float, demand: float, dt: float) -> tuple[float, float]:
    """Advance 1/(1 + T2 s) by one step.

    Example:
        >>> y, pedal = step((0.1,), 0.0, 1.0, 0.1)
        >>> round(pedal, 3)
        0.632
    """
    decay = math.exp(-dt / p[0]) if p[0] > 0 else 0.0
    y = decay * state + (1 - decay) * demand
    return y, y


def column(p: Params, demand: Array, dt: float) -> Array:
    """Return the same along a drive, (n,)."""
    decay = math.exp(-dt / p[0]) if p[0] > 0 else 0.0
    out: Array = lfilter([1 - decay], [1, -decay], demand, zi=[decay * demand[0]])[0]
    return out


EFFECT = Effect(
    id="second_lag",
    says="The output follows the demand with a second lag of {tau} s.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("tau", "s", 0.0, 1.5, (0.2,), 0.2),),
    needs=(),
    source="McRuer & Jex 1967",
    rivals=("radar_latency",),
    absorbed="below 0.5 Hz a second lag is the same as a dead time",
    decides="a pedal signal at 50 Hz or more and a lead that excites above 1 Hz: no drive on a road does",
    identifiable=False,
    pedal=PedalDynamics(init, step, column),
    silent_at=((0.02,),),
)

# the same of a driver who keeps the lane: the ARMAX of Chen & Ulsoy 2001 has two lags of its own
LANE = EFFECT._replace(
    says="The wheel follows the demand with a further lag of {tau} s.",
    rivals=(),
    absorbed="the baseline has two lags and a dead time: below 1 Hz a third lag is the same as more of these",
    decides="a wheel angle at 50 Hz or more and a road that excites above 1 Hz",
)
