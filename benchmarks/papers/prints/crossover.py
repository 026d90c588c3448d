"""Crossover of the printed mean driver with a one-track car (Chen & Ulsoy 2001, Fig. 10; McRuer 1967)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from benchmarks.papers.prints.steering_tables import driver_response
from benchmarks.papers.prints.uncertainty_bound import printed_bound
from canid.values.types import Array
from canid_study.chen_ulsoy.one_track_car import OneTrackCar, in_radians, lateral_response
from canid_study.printed_numbers import STEERING_TABLES, SteeringTable
from canid_study.systems.control_systems import Complex, Margins

# rad/s: from 10 min to just below the Nyquist frequency of 10 Hz
OMEGA = np.geomspace(0.01, 31.0, 3000)
SPEEDS = (20.0, 25.0, 30.0)  # m/s: highway driving
UNITS = ("deg", "rad")  # of the wheel angle in b1 and b2: not printed
# of the crossover frequency: an octave about it, over which the slope is taken
SLOPE_FROM, SLOPE_TO = 0.7, 1.4


class Crossover(NamedTuple):
    """The open loop of the mean driver of one table with the car."""

    table: SteeringTable
    speed: float  # m/s
    unit: str
    response: Complex  # (3000,) over `OMEGA`
    stable: bool
    margins: Margins  # of the first crossover
    slope_db: float  # dB per decade about the crossover
    small_gain: float  # max |Delta P / (1 + L)|, Delta of eq. 5


def crossover(table: SteeringTable, speed: float, unit: str, car: OneTrackCar | None = None) -> Crossover:
    """Margins, slope and small gain of the mean driver with the car.

    Args:
        table: of its means.
        speed: m/s.
        unit: of the wheel angle in b: "deg" or "rad".
        car: an assumption.

    Example:
        >>> found = crossover(STEERING_TABLES[0], 25.0, "deg")
        >>> found.stable, round(found.margins.crossover, 2), round(found.margins.phase_margin_deg, 1)
        (True, 0.62, 37.5)
    """
    car = car or OneTrackCar()

    def loop(omega: Array) -> Complex:
        P = lateral_response(car, speed, omega)
        return in_radians(driver_response(table, omega), unit) * P

    P, L = lateral_response(car, speed, OMEGA), loop(OMEGA)
    magnitude = np.abs(L)
    k = int(np.flatnonzero((magnitude[:-1] >= 1.0) & (magnitude[1:] < 1.0))[0])
    wc = float(brentq(lambda w: math.log(abs(loop(np.array([w]))[0])), OMEGA[k], OMEGA[k + 1], xtol=1e-13))
    at_wc = loop(np.array([wc]))[0]
    phase_margin = math.degrees(np.angle(-at_wc))
    turn = int(np.flatnonzero(np.diff(np.sign(L.imag)) > 0)[0])
    w180 = float(brentq(lambda w: loop(np.array([w]))[0].imag, OMEGA[turn], OMEGA[turn + 1], xtol=1e-13))
    gain_margin = 1.0 / abs(loop(np.array([w180]))[0])
    low, high = np.abs(loop(np.array([SLOPE_FROM * wc, SLOPE_TO * wc])))
    slope = 20.0 * math.log10(high / low) / math.log10(SLOPE_TO / SLOPE_FROM)
    bound = in_radians(printed_bound(OMEGA).astype(np.complex128), unit)
    margins = Margins(
        gain_margin,
        phase_margin,
        wc,
        math.radians(phase_margin % 360.0) / wc,
        float(np.abs(1.0 + L).min()),
        w180,
    )
    return Crossover(
        table,
        speed,
        unit,
        L,
        _stable(L),
        margins,
        slope,
        float(np.abs(bound * P / (1.0 + L)).max()),
    )


def crossovers(car: OneTrackCar | None = None) -> tuple[Crossover, ...]:
    """Estimation means of both tables at `SPEEDS`, b in deg/m and in rad/m.

    Args:
        car: an assumption.
    """
    return tuple(
        crossover(table, speed, unit, car)
        for speed in SPEEDS
        for table in STEERING_TABLES
        if table.part == "estimation"
        for unit in UNITS
    )


def _stable(L: Complex) -> bool:
    """Nyquist: L, stable but for its integrators, does not turn about -1.

    At the lowest frequency two integrators have a phase of nearly -180 degrees from above; 1 + L then turns to the
    Nyquist frequency, where L is real and small, by as much as the phase that it began with.
    """
    turned = float(np.unwrap(np.angle(1.0 + L))[-1])
    return abs(turned) < math.pi
