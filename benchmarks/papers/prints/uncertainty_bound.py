"""The printed bound of |Delta| (Chen & Ulsoy 2001, eq. 5) against the driver that it is the uncertainty of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.papers.prints.steering_tables import driver_response, mean_model
from canid.values.types import Array
from canid_study.printed_numbers import EQ_5_DEN, EQ_5_NUM, SteeringTable
from canid_study.systems import control_systems
from canid_study.systems.control_systems import System

# Hz: within the band that the paper calls reliable (1 Hz), and an octave above
FREQUENCIES_HZ = np.array([0.001, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 2.0])


class BoundRatio(NamedTuple):
    """The bound, the driver and their ratio, at `FREQUENCIES_HZ`."""

    table: SteeringTable
    bound: Array  # (9,)
    driver: Array  # (9,) |G_d| of the means
    ratio: Array  # (9,)
    dc_ratio: float
    below_driver_hz: float  # up to here the bound is below |G_d|


def printed_bound(omega: Array) -> Array:
    """|Delta| of eq. 5 over frequencies in rad/s.

    >>> printed_bound(np.array([1e-9, 1e9])).round(6)
    array([0.2, 5. ])
    """
    out: Array = np.abs(control_systems.frequency_response(System(EQ_5_NUM, EQ_5_DEN), omega))
    return out


def bound_ratio(table: SteeringTable) -> BoundRatio:
    """Compare the bound with |G_d|.

    Args:
        table: of its means.

    Example:
        >>> from canid_study.printed_numbers import STEERING_TABLES
        >>> [round(float(x), 2) for x in bound_ratio(STEERING_TABLES[0]).ratio]
        [0.21, 0.44, 0.5, 0.54, 0.56, 0.61, 0.66, 0.74, 1.05]
    """
    omega = 2.0 * np.pi * FREQUENCIES_HZ
    bound, driver = printed_bound(omega), np.abs(driver_response(table, omega))
    fine = np.geomspace(0.01, 31.0, 2000)
    above = printed_bound(fine) >= np.abs(driver_response(table, fine))
    crossing = float(fine[np.argmax(above)] / (2.0 * np.pi)) if above.any() else np.inf
    dc = EQ_5_NUM[-1] / EQ_5_DEN[-1] / mean_model(table).dc_gain
    return BoundRatio(table, bound, driver, bound / driver, dc, crossing)
