"""The lane-keeping loop: the sampled steering driver A(q) angle = B(q) offset of Chen & Ulsoy 2001 (eq. 1, 3) with a car.

The driver decides every `dt`; between decisions the wheel angle is held (Chen & Ulsoy sample so), or turns evenly, as
`models/simulation/lane.py` turns it. The car is any linear model from wheel angle to lateral offset, sampled exactly (Van
Loan 1978). The offset is positive to the left as the angle is, so that a driver who keeps the lane has b1 + b2 < 0, and the
loop with negative feedback is L = -B/A P.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array
from canid_study.systems import control_systems
from canid_study.systems.control_systems import Margins

Complex = npt.NDArray[np.complex128]

# frequencies of the margins, about 1/40 octave apart
FREQUENCIES = 600
# rad/s of the lowest; a car that returns to its lane more slowly has left it
LOWEST = 0.01


class LateralCar(NamedTuple):
    """dx/dt = A x + B angle, offset = C x; angle in degrees of the wheel, offset in m."""

    A: Array  # (n, n) 1/s
    B: Array  # (n,) per degree and s
    C: Array  # (n,)


class SteeringLoop(NamedTuple):
    """A driver with a car."""

    a: tuple[float, float]
    b: tuple[float, float]  # ° per m
    car: LateralCar
    dt: float = 0.1  # s
    even: bool = False  # the wheel turns evenly from decision to decision; else it is held


def yawing_car(
    speed: float = 25.0, ratio: float = 15.0, wheelbase: float = 2.7, yaw_lag: float = 0.15
) -> LateralCar:
    """The car of `models/simulation/lane.py`: the yaw rate follows the wheels with a lag.

    Args:
        speed: m/s.
        ratio: wheel angle over road-wheel angle.
        wheelbase: m.
        yaw_lag: s.

    Example:
        >>> yawing_car().B.round(3)
        array([0.072, 0.   , 0.   ])
    """
    # states: yaw rate, heading, offset
    A = np.array([[-1.0 / yaw_lag, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, speed, 0.0]])
    B = np.array([math.radians(speed / (ratio * wheelbase)) / yaw_lag, 0.0, 0.0])
    return LateralCar(A, B, np.array([0.0, 0.0, 1.0]))


def sampled(loop: SteeringLoop) -> tuple[Array, Array, Array]:
    """The car over one interval: x' = F x + G0 angle + G1 next angle.

    Returns:
        F (n, n), G0 (n,) and G1 (n,); G1 is 0 where the wheel is held.
    """
    from scipy.linalg import expm

    n, dt = len(loop.car.B), loop.dt
    # states, the angle, and its slope
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n], block[n, n + 1] = loop.car.A, loop.car.B, 1.0
    over = expm(block * dt)
    F, held, slope = over[:n, :n], over[:n, n], over[:n, n + 1] / dt
    if not loop.even:
        return F, held, np.zeros(n)
    return F, held - slope, slope


def loop_response(loop: SteeringLoop, omega: Array) -> Complex:
    """L(e^(j omega dt)).

    Args:
        loop: the driver with the car.
        omega: (n,) rad/s, below the Nyquist frequency.
    """
    F, G0, G1 = sampled(loop)
    z = np.exp(1j * np.asarray(omega) * loop.dt)
    right = G0 + z[:, None] * G1
    states = np.linalg.solve(z[:, None, None] * np.eye(len(F)) - F, right[:, :, None])[:, :, 0]
    driver = (loop.b[0] / z + loop.b[1] / z**2) / (1.0 + loop.a[0] / z + loop.a[1] / z**2)
    out: Complex = -driver * (states @ loop.car.C)
    return out


def closed_loop_poles(loop: SteeringLoop) -> Complex:
    """Poles of the closed loop in z, exactly.

    Example:
        >>> loop = SteeringLoop((-1.2623, 0.3697), (-4.134, 4.0337), yawing_car(), even=True)  # Table 1
        >>> bool(np.abs(closed_loop_poles(loop)).max() < 1.0)
        True
    """
    F, G0, G1 = sampled(loop)
    n = len(F)
    (a1, a2), (b1, b2) = loop.a, loop.b
    C = loop.car.C
    # states: car, angle now and one before, offset one before; nk = 1
    M = np.zeros((n + 3, n + 3))
    angle = np.concatenate([b1 * C, [-a1, -a2, b2]])  # the next one
    M[:n, :n], M[:n, n] = F, G0
    M[:n] += np.outer(G1, angle)
    M[n], M[n + 1, n], M[n + 2, :n] = angle, 1.0, C
    out: Complex = np.linalg.eigvals(M).astype(np.complex128)
    return out


def stable(loop: SteeringLoop) -> bool:
    """Whether the driver keeps the lane."""
    return bool(np.abs(closed_loop_poles(loop)).max() < 1.0)


def margins(loop: SteeringLoop) -> Margins:
    """Stability margins, by python-control; of a loop that is not stable they say nothing.

    Example:
        >>> loop = SteeringLoop((-1.2623, 0.3697), (-4.134, 4.0337), yawing_car(), even=True)
        >>> round(margins(loop).phase_margin_deg)
        34
    """
    nyquist = math.pi / loop.dt
    omega = np.geomspace(LOWEST, nyquist * (1.0 - 1e-6), FREQUENCIES)
    return control_systems.margins(omega, loop_response(loop, omega))
