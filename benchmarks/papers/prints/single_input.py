"""What a fit of one input at a time finds of Grover's printed drivers, without noise: least squares over the lead's motion.

Both inputs come from one motion, the lead's, through the closed loop, so that a model of one input also has to answer for
the other. With the response of headway error and relative speed to the lead known, the first-order model to which an
output-error fit of a long record tends follows by `reduction`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.papers.prints import loop_margins, reduction
from canid.values.types import Array
from canid_study.printed_numbers import GROVER_DRIVERS, THW_DESIRED_S, Driver
from canid_study.systems.control_systems import Complex

# Hz: bandwidth of the lead's speed, from a calm motorway to dense traffic
LEAD_BANDS_HZ = (0.02, 0.05, 0.1)
# s: detrended records hold nothing slower than their length
RECORDS_S = (60.0, 600.0)


class SingleInput(NamedTuple):
    """One printed driver, at one speed behind one lead."""

    driver: Driver
    speed: float  # m/s
    lead_band_hz: float
    record_s: float
    K1_error: float  # relative, of the headway-only model
    K1_fit_percent: float
    lag_at_limit: bool  # of the headway-only model: it has no minimum at a lag that a driver could have
    K2_error: float  # relative, of the model with relative speed only
    K2_fit_percent: float
    correlation: float  # of headway error and relative speed


def single_inputs(car: loop_margins.Car | None = None) -> tuple[SingleInput, ...]:
    """All printed drivers, tau as a lag, at the speeds of `loop_margins`.

    Args:
        car: an assumption.
    """
    car = car or loop_margins.Car()
    return tuple(
        row for driver in GROVER_DRIVERS for speed in loop_margins.SPEEDS for row in _rows(driver, speed, car)
    )


def inputs_and_pedal(driver: Driver, speed: float, car: loop_margins.Car) -> tuple[Complex, Complex, Complex]:
    """Headway error (s), relative speed (m/s) and pedal (%) per m/s of the lead's speed, over `reduction.OMEGA`.

    Args:
        driver: K1, K2 and lags.
        speed: m/s.
        car: an assumption.

    Example: the pedal is what the driver makes of both inputs.
        >>> e, w, pedal = inputs_and_pedal(GROVER_DRIVERS[0], 15.0, loop_margins.Car())
        >>> d, s = GROVER_DRIVERS[0], 1j * reduction.OMEGA
        >>> bool(np.allclose(pedal, d.K1 * e / (1 + d.tau1 * s) + d.K2 * w / (1 + d.tau2 * s)))
        True
    """
    s = 1j * reduction.OMEGA
    F1, F2 = (1.0 / (1.0 + tau * s) for tau in (driver.tau1, driver.tau2))
    P = car.strength / ((1.0 + car.lag * s) * (s + car.drag))
    follow = driver.K1 * F1 / (speed * s) + driver.K2 * F2
    L = (follow + driver.K1 * F1 * THW_DESIRED_S[0] / speed) * P
    v = follow * P / (1.0 + L)  # own speed
    w = 1.0 - v
    e = (w / s - THW_DESIRED_S[0] * v) / speed
    return e, w, driver.K1 * F1 * e + driver.K2 * F2 * w


def _rows(driver: Driver, speed: float, car: loop_margins.Car) -> list[SingleInput]:
    e, w, pedal = inputs_and_pedal(driver, speed, car)
    cases = [(band, record) for band in LEAD_BANDS_HZ for record in RECORDS_S]
    leads = [_lead(band, record) for band, record in cases]
    of_e, of_w = (
        reduction.reductions(
            pedal / x,
            tuple(reduction.Spectrum("", 0.0, "", lead * np.abs(x) ** 2) for lead in leads),
            False,
        )
        for x in (e, w)
    )
    return [
        SingleInput(
            driver,
            speed,
            band,
            record,
            one.K / driver.K1 - 1.0,
            one.fit_percent,
            one.tau > 0.99 * reduction.LARGEST_S,
            other.K / driver.K2 - 1.0,
            other.fit_percent,
            float(
                lead
                @ (e * np.conj(w)).real
                / math.sqrt(float(lead @ np.abs(e) ** 2) * float(lead @ np.abs(w) ** 2))
            ),
        )
        for (band, record), lead, one, other in zip(cases, leads, of_e, of_w, strict=True)
    ]


def _lead(band: float, record: float) -> Array:
    """Power of the lead's speed: low-pass of second order, without what a detrended record does not hold."""
    hz = reduction.OMEGA / (2.0 * math.pi)
    out: Array = np.gradient(reduction.OMEGA) / (1.0 + (hz / band) ** 4) * (hz >= 1.0 / record)
    return out
