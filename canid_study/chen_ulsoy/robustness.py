"""What |Delta| is for: is the loop of driver and car stable for every driver within it (small gain, Zames 1966)?

The driver is G_d + Delta with |Delta| below a bound; the loop with the car P is stable for all of them if
|Delta P / (1 + G_d P)| < 1 at every frequency. Margins by python-control.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import NAN, Array
from canid_study.chen_ulsoy.one_track_car import OneTrackCar, in_radians, lateral_response
from canid_study.chen_ulsoy.unstructured import FREQUENCIES
from canid_study.systems import control_systems
from canid_study.systems.control_systems import DiskMargins, Margins, System

Complex = npt.NDArray[np.complex128]

# rad/s; from well below the slowest zero to 0.9 of the Nyquist frequency of 10 Hz
OMEGA = np.geomspace(0.02, 28.0, 500)
# order of the discrete car in the disk margins: it has four poles
_DT = 0.1


class Robustness(NamedTuple):
    """Loop of one driver with the assumed car."""

    loop: Complex  # (500,) over OMEGA
    stable: bool
    margins: Margins
    disk: DiskMargins | None  # None: the loop is unstable
    small_gain: float  # max |Delta P / (1 + L)| up to 1 Hz; below 1: stable for every Delta within it
    small_gain_hz: float  # where


def of_model(model: Array, magnitude: Array, speed: float, car: OneTrackCar | None = None) -> Robustness:
    """Robust stability of one model.

    Args:
        model: (4,) a1, a2, b1, b2 at 10 Hz, degrees per m.
        magnitude: (F,) bound of |Delta| at `FREQUENCIES`.
        speed: m/s.
        car: None: that of `prints`, a middle-class car of 1,500 kg.
    """
    car = car or OneTrackCar()
    P = in_radians(lateral_response(car, speed, OMEGA), "deg")
    driver = driver_response(model, OMEGA)
    # the error of the driver is minus the position
    L = driver * P
    omega = 2.0 * np.pi * FREQUENCIES
    at = in_radians(lateral_response(car, speed, omega), "deg")
    ratio = magnitude * np.abs(at / (1.0 + driver_response(model, omega) * at))
    worst = int(np.argmax(np.nan_to_num(ratio, nan=-1.0)))
    stable = _stable(model, car, speed)
    disk = None
    if stable:
        disk = control_systems.disk_margins(_loop(model, car, speed), OMEGA)
    return Robustness(
        L,
        stable,
        control_systems.margins(OMEGA, L),
        disk,
        float(ratio[worst]) if stable else NAN,
        float(FREQUENCIES[worst]),
    )


def driver_response(model: Array, omega: Array) -> Complex:
    """B/A on the unit circle."""
    q = np.exp(-1j * omega * _DT)
    out: Complex = (model[2] * q + model[3] * q**2) / (1.0 + model[0] * q + model[1] * q**2)
    return out


def _car_system(car: OneTrackCar, speed: float) -> System:
    """The sampled car as a transfer function: denominator by the one-track model's poles, numerator by its response.

    A strictly proper response of order n has n free numbers; they are solved from as many frequencies and more.
    """
    m, inertia = car.mass, car.yaw_inertia
    lf, lr, Cf, Cr = car.front, car.rear, car.front_stiffness, car.rear_stiffness
    turn = lf * Cf - lr * Cr
    A = np.array(
        [
            [-(Cf + Cr) / (m * speed), -speed - turn / (m * speed)],
            [-turn / (inertia * speed), -(lf**2 * Cf + lr**2 * Cr) / (inertia * speed)],
        ]
    )
    z = np.exp(np.linalg.eigvals(A) * _DT)
    den = np.real(np.poly(np.concatenate([z, [1.0, 1.0]])))
    omega = np.geomspace(0.1, 30.0, 60)
    at = np.exp(1j * omega * _DT)
    wanted = in_radians(lateral_response(car, speed, omega), "deg") * np.polyval(den, at)
    X = np.stack([at**k for k in (3, 2, 1, 0)], axis=1)
    num = np.linalg.lstsq(
        np.concatenate([X.real, X.imag]), np.concatenate([wanted.real, wanted.imag]), rcond=None
    )[0]
    return System(tuple(float(x) for x in num), tuple(float(x) for x in den), _DT)


def _loop(model: Array, car: OneTrackCar, speed: float) -> System:
    of_driver = System((float(model[2]), float(model[3])), (1.0, float(model[0]), float(model[1])), _DT)
    return control_systems.series(of_driver, _car_system(car, speed))


def _stable(model: Array, car: OneTrackCar, speed: float) -> bool:
    """Roots of the closed loop's polynomial: exact, and without a contour around the integrators."""
    loop = _loop(model, car, speed)
    closed = np.polyadd(loop.num, loop.den)
    return bool((np.abs(np.roots(closed)) < 1.0).all())
