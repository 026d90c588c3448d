"""Reduced basis of the responses e^(-theta s) / (1 + tau s) within the box (Hesthaven, Rozza & Stamm 2016).

An input is filtered once by some thirty nodes (tau_k, theta_k); the answer at any other (tau, theta) is their
weighted sum, with weights that do not depend on the data. So a window needs one product of its columns, and a
posterior over thousands of (tau, theta) is small matrices from there on. The nodes are found greedily (a pivoted
Gram-Schmidt: reduced-basis method, Hesthaven, Rozza & Stamm 2016, ch. 3); weights are least squares over
frequencies, weighted as inputs of drivers are.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array

# s; the shortest lag: below a fifth of a sample at 10 Hz a lag is none
TAU_MIN = 0.02

# Hz; where inputs of drivers lose their power (radar and lateral offset, see docs/results.md), how much white content
# is allowed for in addition, and how much stronger the slow drift below 0.02 Hz may be (headway drifts by whole seconds).
CORNER_HZ = 1.0
WHITE_SHARE = 0.01
DRIFT_HZ = 0.02
DRIFT_POWER = 30.0
# Hz; the highest frequency that a grid of 10 Hz holds
MAX_FREQUENCY_HZ = 5.0

# Relative error of the worst answer in the box; the median is a hundredth of it. Without any noise tau then
# comes out to 3 ms and dead time to 0.7 ms, for inputs as rough as an Ornstein-Uhlenbeck process of 0.5 s.
TOLERANCE = 3e-4


class Box(NamedTuple):
    """Where tau and dead time may lie."""

    tau_min: float  # s
    tau_max: float  # s
    dead_time_max: float  # s


class Basis(NamedTuple):
    """The nodes, and what turns the frequency response of an answer into weights."""

    box: Box
    tau: Array  # (b,) s
    dead_time: Array  # (b,) s
    omega: Array  # (f,) rad/s
    solve: Array  # (2 f, b): weights = response, as Re, Im, Re, Im, ... @ solve

    @property
    def size(self) -> int:
        """How many nodes."""
        return len(self.tau)


def _phase_factors(angle: Array) -> npt.NDArray[np.complex128]:
    """e^(-j angle): in real numbers a third of the time."""
    out = np.empty(angle.shape, np.complex128)
    np.cos(angle, out=out.real)
    np.sin(angle, out=out.imag)
    np.negative(out.imag, out=out.imag)
    return out


def _response(tau: Array, dead_time: Array, omega: Array) -> npt.NDArray[np.complex128]:
    H: npt.NDArray[np.complex128] = _phase_factors(dead_time[:, None] * omega) / (
        1.0 + 1j * tau[:, None] * omega
    )
    return H


@cache
def basis(box: Box) -> Basis:
    """Find the nodes for a box; a few milliseconds, and remembered.

    >>> b = basis(Box(TAU_MIN, 3.0, 1.5))
    >>> b.size < 40
    True
    """
    f = np.concatenate([np.geomspace(0.002, 0.1, 14), np.linspace(0.1, MAX_FREQUENCY_HZ, 74)[1:]])
    power = DRIFT_POWER / (1.0 + (f / DRIFT_HZ) ** 2) + 1.0 / (1.0 + (f / CORNER_HZ) ** 4) + WHITE_SHARE
    omega = 2.0 * np.pi * f
    mass = np.sqrt(power * np.gradient(f))
    taus = np.geomspace(box.tau_min, box.tau_max, 24)
    dead_times = np.linspace(0.0, box.dead_time_max, 1 + round(40.0 * max(box.dead_time_max, 0.1)))
    tau, dead_time = (x.ravel() for x in np.meshgrid(taus, dead_times, indexing="ij"))
    H = _response(tau, dead_time, omega) * mass
    A = H.view(np.float64)
    size = np.linalg.norm(A, axis=1)
    rest, nodes = A.copy(), list[int]()
    while len(nodes) < min(A.shape):
        left = np.linalg.norm(rest, axis=1) / size
        worst = int(np.argmax(left))
        if left[worst] < TOLERANCE:
            break
        q = rest[worst] / np.linalg.norm(rest[worst])
        for _ in range(2):  # twice is enough (Kahan, Parlett)
            rest -= np.outer(rest @ q, q)
        nodes.append(worst)
    inverse = np.linalg.pinv(A[nodes])  # (2f, b)
    return Basis(box, tau[nodes], dead_time[nodes], omega, np.repeat(mass, 2)[:, None] * inverse)


def weights(basis: Basis, tau: Array, dead_time: Array) -> Array:
    """Weights of the nodes for other lags and dead times.

    Args:
        basis: of a box.
        tau: (c,) s, inside the box.
        dead_time: (c,) s, inside the box.

    Returns:
        (c, b).

    >>> b = basis(Box(TAU_MIN, 3.0, 1.5))
    >>> bool(np.allclose(weights(b, b.tau, b.dead_time), np.eye(b.size), atol=1e-6))
    True
    """
    node_weights: Array = _response(tau, dead_time, basis.omega).view(np.float64) @ basis.solve
    return node_weights


def weights_on_grid(basis: Basis, tau: Array, dead_time: Array) -> Array:
    """Weights of the nodes for lags, each with dead times that are evenly spaced.

    From one dead time to the next the response turns by the same angle at each frequency: a product instead of a sine.

    Args:
        basis: of a box.
        tau: (r,) s, inside the box.
        dead_time: (r, k) s, inside the box, each row evenly spaced.

    Returns:
        (r k, b).

    >>> b = basis(Box(TAU_MIN, 3.0, 1.5))
    >>> tau, dead_time = np.array([0.3, 0.9]), np.array([[0.1, 0.2, 0.3], [0.2, 0.6, 1.0]])
    >>> plain = weights(b, np.repeat(tau, 3), dead_time.ravel())
    >>> bool(np.allclose(weights_on_grid(b, tau, dead_time), plain, rtol=0.0, atol=1e-12))
    True
    """
    rows, k = dead_time.shape
    H = np.empty((rows, k, len(basis.omega)), np.complex128)
    H[:, 0] = _response(tau, dead_time[:, 0], basis.omega)
    turn = _phase_factors((dead_time[:, -1:] - dead_time[:, :1]) / max(k - 1, 1) * basis.omega)[:, None]
    done = 1
    while done < k:  # by doubling
        more = min(done, k - done)
        np.multiply(H[:, :more], turn, out=H[:, done : done + more])
        done, turn = done + more, turn * turn
    node_weights: Array = H.reshape(rows * k, -1).view(np.float64) @ basis.solve
    return node_weights


def with_slopes(basis: Basis, tau: Array, dead_time: Array) -> Array:
    """Weights of the answers (c, b), of their derivatives by tau and by dead time, per s: (3, c, b)."""
    H, jw = _response(tau, dead_time, basis.omega), 1j * basis.omega
    every = np.concatenate([H, -jw / (1.0 + jw * tau[:, None]) * H, -jw * H])
    node_weights: Array = every.view(np.float64) @ basis.solve
    return node_weights.reshape(3, len(tau), -1)
