"""First order plus dead time by other ways: functions of (y, u, dt, settle) that return K, tau, dead time."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import curve_fit
from scipy.signal import lfilter

from benchmarks.identification.peers.peer import Peer
from benchmarks.identification.peers.regressors import arx

# the box that canid has too, s
LOW, HIGH = (0.01, 0.0), (3.0, 1.5)
# guesses of a person who has read Grover 2021
GUESS = (0.4, 0.25)


def lag(u: np.ndarray, dt: float, tau: float, dead_time: float) -> np.ndarray:
    """Answer as scripts write it: the input shifted by interpolation, then a sampled first-order filter."""
    t = np.arange(len(u)) * dt
    alpha = math.exp(-dt / tau)
    shifted = np.interp(t - dead_time, t, u)
    x0 = shifted[0]
    return x0 + lfilter([0.0, 1.0 - alpha], [1.0, -alpha], shifted - x0)


def joint(
    y: np.ndarray, inputs: list[np.ndarray], dt: float, settle: int, usable: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Fit all inputs by output error: K tau theta of each, and their nominal covariance.

    Rows before `settle`, and those that are not `usable` (n,), are left out.
    """
    m = len(inputs)
    rows = np.arange(len(y)) >= settle
    rows = rows if usable is None else rows & usable

    def model(_: object, *p: float) -> np.ndarray:
        total = np.full(len(y), p[-1])
        for i, u in enumerate(inputs):
            total += p[3 * i] * lag(u, dt, p[3 * i + 1], p[3 * i + 2])
        return total[rows]

    start = [*(1.0, *GUESS) * m, float(np.mean(y[rows]))]
    low = [*(-np.inf, *LOW) * m, -np.inf]
    high = [*(np.inf, *HIGH) * m, np.inf]
    found, covariance = curve_fit(model, None, y[rows], start, bounds=(low, high), x_scale="jac")
    return found[:-1], covariance[:-1, :-1]


def recipe(y: np.ndarray, u: np.ndarray, dt: float, settle: int) -> np.ndarray:
    return joint(y, [u], dt, settle)[0]


def recipe_with_sd(y: np.ndarray, u: np.ndarray, dt: float, settle: int) -> tuple[np.ndarray, np.ndarray]:
    found, covariance = joint(y, [u], dt, settle)
    return found, np.sqrt(np.diag(covariance))


def first_order(y: np.ndarray, inputs: list[np.ndarray], dt: float, settle: int) -> list[np.ndarray]:
    """ARX(1,1) with the best whole dead time: K tau theta of each input; one dead time for each is searched in turn."""
    most = round(HIGH[1] / dt)
    step = max(1, round(0.02 / dt))
    nk = [1 + round(GUESS[1] / dt)] * len(inputs)
    for _ in range(1 if len(inputs) == 1 else 2):
        for i in range(len(inputs)):
            trials = range(1, most + 2, step)
            nk[i] = min(
                trials,
                key=lambda k: arx(y, inputs, 1, 1, [k if j == i else d for j, d in enumerate(nk)], settle)[1],
            )
    theta, _ = arx(y, inputs, 1, 1, nk, settle)
    pole = -theta[0]
    tau = -dt / math.log(pole) if 0.0 < pole < 1.0 else math.nan
    return [np.array([theta[1 + i] / (1.0 - pole), tau, (k - 1) * dt]) for i, k in enumerate(nk)]


def arx_search(y: np.ndarray, u: np.ndarray, dt: float, settle: int) -> np.ndarray:
    return first_order(y, [u], dt, settle)[0]


def arx_search_10(y: np.ndarray, u: np.ndarray, dt: float, settle: int) -> np.ndarray:
    every = round(0.1 / dt)
    return first_order(y[::every], [u[::every]], dt * every, settle // every)[0]


def grover(y: np.ndarray, u: np.ndarray, dt: float, settle: int) -> np.ndarray:
    """Grover 2021: ARX of order 11, and a process model fitted to its simulated answer."""
    order = 11
    theta, _ = arx(y, [u], order, order, [1], settle)
    A, B = np.append(1.0, theta[:order]), np.append(0.0, theta[order : 2 * order])
    if np.abs(np.roots(A)).max() >= 1.0:
        return np.full(3, np.nan)
    simulated = lfilter(B, A, u - u[0]) + u[0] * B.sum() / A.sum()
    return recipe(simulated, u, dt, settle)


PROCESS = (
    Peer("scipy curve_fit recipe", recipe),
    Peer("ARX(1,1) + dead-time search, 100 Hz", arx_search),
    Peer("ARX(1,1) + dead-time search, 10 Hz", arx_search_10),
    Peer("Grover: ARX order 11, then process fit", grover),
)
INTERVALS = (Peer("scipy curve_fit, its own covariance", recipe_with_sd),)
