"""A driver, and the car, as one drive identified them: all that a simulation of another drive needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from canid.values.types import Array, Interval

# of the driver: u = offset + K1 L1[error] + K2 L2[range_rate] + noise; what the error is depends on the form
DRIVER = (
    "offset", "K1", "K2", "tau1", "tau2", "dead_time1", "dead_time2", "headway_desired", "standstill", "free_speed",
)  # fmt: skip


class NoiseLaw(NamedTuple):
    """n(t) = Σ coefficients[i] n(t − (i + 1) step) + sd e(t), e white with variance 1."""

    step: float  # s
    coefficients: tuple[float, ...]
    sd: float  # output unit


class CarLaw(NamedTuple):
    """a = strength · lag[pedal] − brake · lag[demand below 0] − rolling − drag · speed²."""

    strength: float  # m/s² per %
    lag: float  # s
    rolling: float  # m/s²
    drag: float  # 1/m
    brake: float  # m/s² per % of demand below 0


class IdentifiedModel(NamedTuple):
    """The model of one driver in one car."""

    output: str  # role: "pedal", "accel"
    form: str  # of the baseline: "time_headway", "gap", "free_speed"
    driver: Mapping[str, float]  # DRIVER; of standstill and free_speed those count that the form has
    covariance: Array  # (k, k) of `names`, 95 % intervals are those of a normal; 0 where a parameter was held
    names: tuple[str, ...]  # DRIVER, and "effect.parameter" of what was fitted with them
    effects: Mapping[str, Mapping[str, float]]  # id -> parameter -> value; of driver, vehicle and remnant
    noise: NoiseLaw
    car: CarLaw | None  # None: the output is the acceleration itself
    driven: Mapping[str, Interval]  # role -> median, and the 5 and 95 % points of what was driven


def stationary(coefficients: Sequence[float]) -> bool:
    """Are all poles of an autoregressive noise inside the unit circle?

    Example:
        >>> stationary((0.9,)), stationary((1.2, -0.1)), stationary(())
        (True, False, True)
    """
    return not len(coefficients) or bool(np.all(np.abs(np.roots([1.0, *(-x for x in coefficients)])) < 1.0))
