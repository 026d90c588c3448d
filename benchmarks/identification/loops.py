"""What a closed car-following loop hands out, whoever wrote it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.identification.bounds import Lag

# factor on both gains at times (n,) in s since the drive's first row; before 0 the loop settles
Gain = Callable[[np.ndarray], np.ndarray]


def constant(t: np.ndarray) -> np.ndarray:
    """Return the factor of a driver who does not change."""
    return np.ones(len(t))


class Drive(NamedTuple):
    """The truth of one drive on a uniform grid."""

    dt: float  # s
    pedal: np.ndarray  # (n,) %, as the bus would say it
    brake: np.ndarray  # (n,) bool
    speed: np.ndarray  # (n,) m/s
    gap: np.ndarray  # (n,) m
    range_rate: np.ndarray  # (n,) m/s
    headway_desired: float  # s
    channels: tuple[Lag, Lag]  # answers to headway error and to range rate
    sigma: float  # % of the remnant
    uniform: bool  # the radar's errors are uniform and quantised, not Gaussian
    exact: np.ndarray  # (n,) bool: the pedal follows the demand: no floor, no brake

    @property
    def inputs(self) -> tuple[np.ndarray, np.ndarray]:
        """Headway error and range rate without any sensor between."""
        return self.gap / self.speed - self.headway_desired, self.range_rate


class Lead(NamedTuple):
    """How lively the vehicle ahead drives."""

    name: str
    sd: float = 1.5  # m/s
    cut: float = 0.05  # Hz


LEADS = (Lead("calm", 0.7, 0.03), Lead("normal"), Lead("lively", 2.5, 0.15))
NORMAL = LEADS[1]
