"""A plain generalised least squares of two first-order answers with AR(5) noise, by scipy: what a colleague would write."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

ORDER = 5
ROUNDS = 3
BOX = ([0.02, 0.0, 0.02, 0.0], [3.0, 1.5, 3.0, 1.5])  # s


class Answer(NamedTuple):
    """Estimates with their standard deviations: K1, K2, and the sum of lag and dead time of the second input."""

    value: np.ndarray  # (3,)
    sd: np.ndarray  # (3,)


def fit(y: np.ndarray, u: np.ndarray, dt: float, settle: float = 4.5) -> Answer:
    """Fit (n,) to inputs (n, 2); the gains are linear inside, the noise model is refitted after each round."""
    n, first = len(y), round(settle / dt)
    t = np.arange(n) * dt
    noise = np.zeros(0)

    def columns(q: np.ndarray) -> np.ndarray:
        out = [np.ones(n)]
        for k in range(2):
            decay = np.exp(-dt / q[2 * k])
            late = np.interp(t - q[2 * k + 1], t, u[:, k])
            out.append(lfilter([1.0 - decay], [1.0, -decay], late - late[0]) + late[0])
        return np.column_stack(out)

    def white(x: np.ndarray) -> np.ndarray:
        return np.asarray(lfilter(np.r_[1.0, -noise], [1.0], x, axis=0))[first:]

    def gains(q: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(white(columns(q)), white(y), rcond=None)[0]

    q = np.array([0.5, 0.3, 0.5, 0.3])
    for _ in range(ROUNDS):
        q = least_squares(lambda q: white(y) - white(columns(q)) @ gains(q), q, bounds=BOX, diff_step=1e-3).x
        r = y - columns(q) @ gains(q)
        lags = np.column_stack([r[ORDER - k : n - k] for k in range(1, ORDER + 1)])
        noise = np.linalg.lstsq(lags[first:], r[ORDER:][first:], rcond=None)[0]
    K = gains(q)
    full = np.r_[K, q]

    def model(p: np.ndarray) -> np.ndarray:
        return white(columns(p[3:]) @ p[:3])

    base = model(full)
    J = np.column_stack([(model(full + 1e-4 * e) - base) / 1e-4 for e in np.eye(len(full))])
    variance = float(np.var(white(y) - base))
    C = variance * np.linalg.pinv(J.T @ J)
    total = np.zeros(len(full))
    total[5:7] = 1.0
    sd = np.sqrt([C[1, 1], C[2, 2], total @ C @ total])
    return Answer(np.array([K[1], K[2], q[2] + q[3]]), sd)
