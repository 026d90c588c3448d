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


def answer(u: np.ndarray, dt: float, tau: float, dead_time: float) -> np.ndarray:
    """Answer of unit gain (n,): the input shifted, then a lag, exact for an input that is joined by lines."""
    t = np.arange(len(u)) * dt
    decay = np.exp(-dt / tau)
    new = 1.0 - tau / dt * (1.0 - decay)
    late = np.interp(t - dead_time, t, u)
    return np.asarray(lfilter([new, 1.0 - decay - new], [1.0, -decay], late - late[0])) + late[0]


def _columns(u: np.ndarray, dt: float, q: np.ndarray) -> np.ndarray:
    answers = (answer(u[:, k], dt, q[2 * k], q[2 * k + 1]) for k in range(2))
    return np.column_stack([np.ones(len(u)), *answers])


def _white(x: np.ndarray, noise: np.ndarray, kept: np.ndarray) -> np.ndarray:
    return np.asarray(lfilter(np.r_[1.0, -noise], [1.0], x, axis=0))[kept]


def _kept(n: int, first: int, usable: np.ndarray | None) -> np.ndarray:
    """Rows that are usable with all that the noise model predicts them from."""
    seen = np.full(n, True) if usable is None else usable
    whole = np.convolve(seen, np.ones(ORDER + 1))[:n] > ORDER + 0.5
    return np.flatnonzero(whole & (np.arange(n) >= first))


def autoregression(r: np.ndarray, order: int, usable: np.ndarray) -> list[float]:
    """Coefficients and variance of an autoregression by least squares."""
    kept = _kept(len(r), ORDER, usable)
    lags = np.column_stack([r[kept - k] for k in range(1, order + 1)])
    found = np.linalg.lstsq(lags, r[kept], rcond=None)[0]
    return [*map(float, found), float(np.var(r[kept] - lags @ found))]


def parameters(
    y: np.ndarray, u: np.ndarray, dt: float, settle: float, usable: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit (n,) to inputs (n, 2), where `usable` (n,): offset and gains (3,), delays (4,), noise (ORDER,).

    The gains are linear inside, the noise model is refitted after each round.
    """
    kept = _kept(len(y), round(settle / dt), usable)
    noise = np.zeros(0)

    def gains(q: np.ndarray) -> np.ndarray:
        X = _white(_columns(u, dt, q), noise, kept)
        return np.linalg.lstsq(X, _white(y, noise, kept), rcond=None)[0]

    def misfit(q: np.ndarray) -> np.ndarray:
        return _white(y, noise, kept) - _white(_columns(u, dt, q), noise, kept) @ gains(q)

    q = np.array([0.5, 0.3, 0.5, 0.3])
    for _ in range(ROUNDS):
        q = least_squares(misfit, q, bounds=BOX, diff_step=1e-3).x
        r = y - _columns(u, dt, q) @ gains(q)
        lags = np.column_stack([r[kept - k] for k in range(1, ORDER + 1)])
        noise = np.linalg.lstsq(lags, r[kept], rcond=None)[0]
    return gains(q), q, noise


def fit(
    y: np.ndarray, u: np.ndarray, dt: float, settle: float = 4.5, usable: np.ndarray | None = None
) -> Answer:
    """Fit (n,) to inputs (n, 2), with intervals by the linearised model; rows that are not `usable` are left out."""
    K, q, noise = parameters(y, u, dt, settle, usable)
    kept = _kept(len(y), round(settle / dt), usable)
    full = np.r_[K, q]

    def model(p: np.ndarray) -> np.ndarray:
        return _white(_columns(u, dt, p[3:]) @ p[:3], noise, kept)

    base = model(full)
    J = np.column_stack([(model(full + 1e-4 * e) - base) / 1e-4 for e in np.eye(len(full))])
    variance = float(np.var(_white(y, noise, kept) - base))
    C = variance * np.linalg.pinv(J.T @ J)
    total = np.zeros(len(full))
    total[5:7] = 1.0
    sd = np.sqrt([C[1, 1], C[2, 2], total @ C @ total])
    return Answer(np.array([K[1], K[2], q[2] + q[3]]), sd)
