"""Margins and string stability of Grover's printed drivers with an assumed car, tau read as a lag and as a dead time.

The driver presses K1 (headway - desired) + K2 (v_lead - v); about a steady speed v the headway is (gap - THW v) / v, so
that, from the car's speed to the pedal and back, L = (K1 F1 (1/s + THW) / v + K2 F2) P, P from the pedal to the speed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.types import Array
from canid_study.printed_numbers import GROVER_DRIVERS, THW_DESIRED_S, Driver
from canid_study.systems import control_systems
from canid_study.systems.control_systems import Complex, DiskMargins, Margins, System

# rad/s: from 20 min to 3 Hz, past every crossover of these loops
OMEGA = np.geomspace(0.005, 20.0, 3000)
# every tenth is enough for margins, which python-control interpolates by splines, in a tenth of the time
_COARSE = slice(None, None, 10)
SPEEDS = (8.0, 15.0, 25.0)  # m/s: town, country road, motorway
LAG, DEAD_TIME = "lag", "dead time"


class Car(NamedTuple):
    """From pedal to speed: strength / ((1 + lag s) (s + drag)).

    The paper prints no car; this is one of the middle class.
    """

    strength: float = 0.04  # m/s² per % of pedal
    lag: float = 0.3  # s, of engine and driveline
    drag: float = 0.05  # 1/s, by which air and rolling resistance grow with the speed


class Loop(NamedTuple):
    """A driver with a car at one speed."""

    driver: Driver
    reading: str  # `LAG` or `DEAD_TIME`: what tau is
    speed: float  # m/s
    response: Complex  # (3000,) of L over `OMEGA`
    margins: Margins
    disk: DiskMargins
    string: Array  # (3000,) |v / v_lead|
    string_peak: float
    string_peak_hz: float


def loop(
    driver: Driver,
    reading: str,
    speed: float,
    car: Car | None = None,
    headway: float = THW_DESIRED_S[0],
) -> Loop:
    """Margins, disk margins and string stability of a driver with a car.

    Args:
        driver: K1 in % per s, K2 in % per m/s.
        reading: `LAG`, K / (1 + tau s), or `DEAD_TIME`, K e^(-tau s).
        speed: m/s, about which the loop is linearised.
        car: an assumption.
        headway: s, wanted.

    Example:
        >>> found = loop(GROVER_DRIVERS[0], LAG, 8.0)
        >>> round(found.margins.phase_margin_deg, 2), round(found.margins.delay_margin_s, 3)
        (71.31, 3.502)
    """
    car = car or Car()
    F1, F2 = (_channel(reading, tau) for tau in (driver.tau1, driver.tau2))
    by_gap = System((driver.K1 / speed,), (1.0, 0.0))
    vehicle = System((car.strength,), tuple(np.polymul((car.lag, 1.0), (1.0, car.drag)).tolist()))

    def over(g: System) -> Complex:
        return control_systems.frequency_response(g, OMEGA)

    P, gap_path = over(vehicle), over(F1) * over(by_gap)
    rate_path = driver.K2 * over(F2)
    L = (gap_path * (1.0 + 1j * OMEGA * headway) + rate_path) * P
    string = np.abs((gap_path + rate_path) * P / (1.0 + L))
    top = int(np.argmax(string))
    # at 0, below the grid, the car follows its lead exactly: no peak is below 1
    peak, peak_at = (float(string[top]), float(OMEGA[top])) if string[top] > 1.0 else (1.0, 0.0)
    return Loop(
        driver,
        reading,
        speed,
        L,
        control_systems.margins(OMEGA[_COARSE], L[_COARSE])._replace(
            modulus_margin=float(np.abs(1.0 + L).min())
        ),
        disk_margins(L),
        string,
        peak,
        peak_at / (2.0 * np.pi),
    )


def loops(car: Car | None = None) -> tuple[Loop, ...]:
    """All printed drivers at `SPEEDS`, tau as a lag and as a dead time.

    Args:
        car: an assumption.
    """
    return tuple(
        loop(driver, reading, speed, car)
        for speed in SPEEDS
        for driver in GROVER_DRIVERS
        for reading in (LAG, DEAD_TIME)
    )


def _channel(reading: str, tau: float) -> System:
    if reading == LAG:
        return control_systems.first_order(1.0, tau)
    return control_systems.first_order(1.0, 0.0, tau)


def disk_margins(response: Complex) -> DiskMargins:
    """Balanced disk margins from a response, exact dead times included (Seiler, Packard & Gahinet 2020, sec. 3).

    alpha = min 2 |1 + L| / |1 - L|; gain and phase margins of the disk follow from it.

    Args:
        response: (n,) of a loop that is stable when closed.

    Example: an integrator has an infinite gain and 90 degrees of phase margin.
        >>> found = disk_margins(1.0 / (1j * OMEGA))
        >>> round(found.disk, 6), round(found.phase_margin_deg, 3)
        (2.0, 90.0)
    """
    alpha = float(np.min(2.0 * np.abs(1.0 + response) / np.abs(1.0 - response)))
    gain = (2.0 + alpha) / (2.0 - alpha) if alpha < 2.0 else np.inf
    return DiskMargins(alpha, float(gain), float(np.degrees(2.0 * np.arctan(alpha / 2.0))))
