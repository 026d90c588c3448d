"""Turbo lag: at low load the charger must spin up first, and the force comes later than at high load."""

from __future__ import annotations

import numpy as np

from canid.models.effects.effect import (
    Effect,
    Kind,
    Parameter,
    Params,
    Value,
    VehicleHooks,
    VehicleState,
    more_than,
)

# % of pedal at which the exhaust keeps the charger at half its speed, and the width of the transition
HALF_PERCENT, WIDTH_PERCENT = 12.0, 4.0


def lag(p: Params, state: VehicleState) -> Value:
    """Return the further lag, s: all of it at low load, none at high.

    Example:
        >>> lag((0.8,), VehicleState(0.0, 10.0, 20.0, 0.0, 4.0, np.array([0.0, 12.0, 40.0]), 0.04)).round(2).tolist()
        [0.76, 0.4, 0.0]
    """
    return p[0] / (1 + np.exp((state.lagged_pedal - HALF_PERCENT) / WIDTH_PERCENT))


EFFECT = Effect(
    id="turbo_lag",
    says="At low load the engine responds {tau} s later.",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(Parameter("tau", "s", 0.0, 4.0, (0.6,), 0.8),),
    needs=("pedal",),
    source="turbochargers: 0.5 to 1.5 s from low load (Heywood 1988, ch. 6)",
    decides="pressing the pedal both from low and from high load",
    vehicle=VehicleHooks(lag=lag),
    unusual=more_than(0.2),  # s; every engine answers a little later from low load
    found_at=((1.0,), (1.5,)),
    silent_at=((0.05,),),
)
