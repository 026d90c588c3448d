"""At low load the charger must spin up first: the pull comes later than at high load."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Car, CarSeen, Effect, Parameter, Params, Value

# % of pedal at which the exhaust keeps the charger half ready, and over which range that changes
HALF, RANGE = 12.0, 4.0


def lag(p: Params, seen: CarSeen) -> Value:
    """Return the further lag, s: all of it at low load, none at high.

    Example:
        >>> lag((0.8,), CarSeen(0.0, 10.0, 20.0, 0.0, 4.0, np.array([0.0, 12.0, 40.0]), 0.04)).round(2).tolist()
        [0.76, 0.4, 0.0]
    """
    return p[0] / (1 + np.exp((seen.drive - HALF) / RANGE))


EFFECT = Effect(
    id="turbo_lag",
    says="At low load the engine's answer is {tau} s slower.",
    where="vehicle",
    kind="curve",
    parameters=(Parameter("tau", "s", 0.0, 4.0, (0.6,), 0.8),),
    needs=("pedal",),
    source="turbochargers: 0.5 to 1.5 s from low load (Heywood 1988, ch. 6)",
    decides="pressing the pedal both from low and from high load",
    car=Car(lag=lag),
    planted=((0.8,), (1.2,)),
)
