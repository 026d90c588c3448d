"""What a published car-following model is here: its parameters and its acceleration."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from canid.values.types import Array

# gap m, own speed m/s, lead's speed m/s -> acceleration m/s²; arrays that broadcast with a parameter's
Acceleration = Callable[[Array, Array, Array, Array], Array]


class RivalParameter(NamedTuple):
    """A parameter with the range in which it is calibrated: logarithmic where `low` is above 0, else linear."""

    name: str
    unit: str
    low: float
    high: float


class RivalModel(NamedTuple):
    """A car-following model: (parameters (k, ...), gap, speed, lead speed) -> acceleration."""

    name: str
    source: str
    parameters: tuple[RivalParameter, ...]
    acceleration: Acceleration

    def physical(self, x: Array) -> Array:
        """Map the unit cube (k, ...) onto the parameters' ranges.

        Example:
            >>> one = RivalModel("", "", (RivalParameter("T", "s", 0.1, 10.0),), lambda q, s, v, u: s)
            >>> one.physical(np.array([0.0, 0.5, 1.0])[None])
            array([[ 0.1,  1. , 10. ]])
        """
        out = np.empty_like(x)
        for k, parameter in enumerate(self.parameters):
            if parameter.low > 0:
                out[k] = parameter.low * (parameter.high / parameter.low) ** x[k]
            else:
                out[k] = parameter.low + (parameter.high - parameter.low) * x[k]
        return out
