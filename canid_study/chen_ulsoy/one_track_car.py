"""One-track car from the steering wheel to the lateral position, sampled with a hold (Riekert & Schunck 1940)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from canid.values.types import Array
from canid_study.printed_numbers import STEERING_INTERVAL_S
from canid_study.systems.control_systems import Complex


class OneTrackCar(NamedTuple):
    """A middle-class car. The paper prints no car: these values are an assumption."""

    mass: float = 1500.0  # kg
    yaw_inertia: float = 2500.0  # kg m²
    front: float = 1.2  # m, from the center of gravity to the front axle
    rear: float = 1.5  # m, to the rear axle
    front_stiffness: float = 80_000.0  # N/rad, cornering stiffness of the axle
    rear_stiffness: float = 90_000.0  # N/rad
    steering_ratio: float = 15.0


def lateral_response(car: OneTrackCar, speed: float, omega: Array) -> Complex:
    """Lateral position (m) of a wheel angle (rad) that is held for `STEERING_INTERVAL_S`.

    Args:
        car: an assumption.
        speed: m/s.
        omega: (n,) rad/s, below the Nyquist frequency.

    Returns:
        (n,) m/rad.

    Example: slow steering moves the car by V^2 / (ratio (L + k V^2)) / omega^2, k the understeer gradient.
        >>> g, k = lateral_response(OneTrackCar(), 25.0, np.array([0.01]))[0], 1500.0 * 39_000.0 / (2.7 * 7.2e9)
        >>> round(float(abs(g)) * 0.01**2 * 15.0 * (2.7 + k * 25.0**2) / 25.0**2, 3), bool(g.real < 0)
        (1.0, True)
    """
    A, B = matrices(car, speed)
    # zero-order hold by one matrix exponential (Van Loan 1978)
    block = np.zeros((5, 5))
    block[:4, :4], block[:4, 4] = A, B
    sampled = expm(block * STEERING_INTERVAL_S)
    z = np.exp(1j * np.asarray(omega) * STEERING_INTERVAL_S)
    states = np.linalg.solve(
        z[:, None, None] * np.eye(4) - sampled[:4, :4], np.broadcast_to(sampled[:4, 4:], (len(z), 4, 1))
    )
    out: Complex = states[:, 3, 0]
    return out


def matrices(car: OneTrackCar, speed: float) -> tuple[Array, Array]:
    """State matrix (4, 4) and input column (4,) of the wheel angle in rad, at a speed in m/s.

    States: lateral velocity, yaw rate, heading, lateral position.
    """
    m, I = car.mass, car.yaw_inertia  # noqa: E741 - the moment of inertia's own letter
    lf, lr, Cf, Cr = car.front, car.rear, car.front_stiffness, car.rear_stiffness
    turn = lf * Cf - lr * Cr
    A = np.array(
        [
            [-(Cf + Cr) / (m * speed), -speed - turn / (m * speed), 0.0, 0.0],
            [-turn / (I * speed), -(lf**2 * Cf + lr**2 * Cr) / (I * speed), 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [1.0, 0.0, speed, 0.0],
        ]
    )
    B = np.array([Cf / m, lf * Cf / I, 0.0, 0.0]) / car.steering_ratio
    return A, B


def in_radians(response: Complex, unit: str) -> Complex:
    """The same driver, whose b is in degrees of wheel angle per meter, in rad per meter.

    >>> in_radians(np.array([180.0 + 0j]), "deg").round(6)
    array([3.141593+0.j])
    """
    return response * math.radians(1.0) if unit == "deg" else response
