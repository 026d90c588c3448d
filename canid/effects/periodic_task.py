"""A line in the pedal's spectrum: a secondary task with a rhythm."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Effect, Parameter, Params, Seen, Value


def act(p: Params, seen: Seen) -> Value:
    """Return A sin(2πft + φ), %.

    Example:
        >>> round(float(act((2.0, 0.25, 0.0), Seen(1.0, 600.0, 2.0, -1.0, 60.0, 33.0, 0.0))), 6)
        2.0
    """
    return p[0] * np.sin(2 * np.pi * p[1] * seen.t + p[2])


EFFECT = Effect(
    id="periodic_task",
    says="The pedal swings by {amplitude} % at {frequency} Hz, whatever the lead does.",
    where="driver",
    kind="line",
    parameters=(
        Parameter("amplitude", "%", 0.0, 20.0, (), 2.0),
        Parameter("frequency", "Hz", 0.02, 2.0, (), 0.1),
        Parameter("phase", "rad", -np.pi, np.pi, (), 0.0),
    ),
    needs=(),
    source="glances and secondary tasks with a rhythm: Klauer et al. 2006",
    decides="10 min of following",
    extra=act,
    planted=((2.5, 0.12, 0.0), (3.0, 0.2, 1.0)),
)
