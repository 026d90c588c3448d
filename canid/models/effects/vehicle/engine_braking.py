"""Engine braking with the pedal released: overrun, or recuperation."""

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

# % of pedal at which half of it acts, and the width of the transition: maps differ between a kink and a slow bend, and
# a transition of this width represents both
HALF_PERCENT, WIDTH_PERCENT = 2.0, 1.0


def push(p: Params, state: VehicleState) -> Value:
    """Return what the engine takes, m/s²: all of it at rest, half of it at `HALF_PERCENT`.

    Part of it comes at once, as a fuel cut-off does, the rest with the engine's lag.

    Example:
        >>> state = VehicleState(0.0, np.array([0.0, 0.0, 5.0]), 20.0, 0.0, 4.0, np.array([0.0, 2.0, 5.0]), 0.04)
        >>> push((0.4, 0.0), state).round(2).tolist()
        [-0.35, -0.2, -0.02]
        >>> push((0.4, 1.0), state).round(2).tolist()
        [-0.35, -0.35, -0.02]
    """
    return -p[0] * (p[1] * _off(state.pedal) + (1 - p[1]) * _off(state.lagged_pedal))


def _off(pressed: Value) -> Value:
    """How far the pedal is released, 0 to 1; clipped where a float's exponential would overflow."""
    return 1 / (1 + np.exp(np.clip((pressed - HALF_PERCENT) / WIDTH_PERCENT, -30, 30)))


EFFECT = Effect(
    id="engine_braking",
    says="With the pedal released, the engine brakes by {strength} m/s² more than a linear pedal map gives.",
    where="vehicle",
    kind=Kind.PARAMETRIC,
    parameters=(
        Parameter("strength", "m/s²", -1.0, 3.0, (0.3,), 0.3),
        Parameter("prompt", "1", 0.0, 1.0, (0.0, 1.0), 0.5),
    ),
    needs=("pedal",),
    source="overrun cut-off; recuperation of electric cars",
    decides="coasting without the brake",
    vehicle=VehicleHooks(push=push),
    unusual=more_than(0.2),  # m/s²; an idling engine takes 0.05 to 0.15
    found_at=((0.6, 0.0), (0.8, 1.0)),
    silent_at=((0.03, 0.5),),
)
