"""With the foot off the pedal the engine does not idle along but brakes: overrun, or recuperation."""

from __future__ import annotations

import numpy as np

from canid.effects.cause import Car, CarSeen, Effect, Parameter, Params, Value

# % of pedal at which half of it is there, and over which range it comes: maps differ between a kink and a slow bend, and
# a bend of this width stands for both
RESTING, RANGE = 2.0, 1.0


def push(p: Params, seen: CarSeen) -> Value:
    """Return what the engine takes, m/s²: all of it at rest, half of it at `RESTING`.

    Part of it comes at once, as a fuel cut-off does, the rest with the engine's lag.

    Example:
        >>> seen = CarSeen(0.0, np.array([0.0, 0.0, 5.0]), 20.0, 0.0, 4.0, np.array([0.0, 2.0, 5.0]), 0.04)
        >>> push((0.4, 0.0), seen).round(2).tolist()
        [-0.35, -0.2, -0.02]
        >>> push((0.4, 1.0), seen).round(2).tolist()
        [-0.35, -0.35, -0.02]
    """
    return -p[0] * (p[1] * _off(seen.pedal) + (1 - p[1]) * _off(seen.drive))


def _off(pressed: Value) -> Value:
    """How far the foot is off, 0 to 1; clipped where a float's exponential would overflow."""
    return 1 / (1 + np.exp(np.clip((pressed - RESTING) / RANGE, -30, 30)))


EFFECT = Effect(
    id="engine_braking",
    says="With the foot off, the engine brakes by {strength} m/s² more than the map's straight line says.",
    where="vehicle",
    kind="curve",
    parameters=(
        Parameter("strength", "m/s²", -1.0, 3.0, (0.3,), 0.3),
        Parameter("prompt", "1", 0.0, 1.0, (0.0, 1.0), 0.5),
    ),
    needs=("pedal",),
    source="overrun cut-off; recuperation of electric cars",
    decides="coasting without the brake",
    car=Car(push=push),
    planted=((0.5, 0.0), (0.7, 1.0)),
)
