"""The Cramér-Rao bound of a drive: what its true inputs show, behind the true noise's autoregression of order 12."""

from __future__ import annotations

import numpy as np

from tests.plants.outside_form import Driven, H, World

ORDER = 12


def _answer(u: np.ndarray, tau: float, theta: float) -> np.ndarray:
    """Answer to unit gain, (n,) at 100 Hz."""
    out, x, f, late = np.zeros(len(u)), 0.0, 1.0 - np.exp(-H / tau), theta / H
    whole, part = int(late), late - int(late)
    delayed = np.zeros(len(u))
    delayed[whole + 1 :] = (1.0 - part) * u[1 : len(u) - whole] + part * u[: len(u) - whole - 1]
    for k, value in enumerate(delayed.tolist()):
        x += f * (value - x)
        out[k] = x
    return out


def deviations(world: World, driven: Driven, start: float, usable: np.ndarray) -> dict[str, float]:
    """Least standard deviations by name: K1, K2, tau2, theta2, sum1, sum2; `usable` (n,) at 10 Hz from `start` s on."""
    v = np.maximum(driven.speed, 2.0)
    inputs = (driven.gap / v - world.headway - world.standstill / v, driven.rate)
    J = []
    for u, K, tau, theta in zip(inputs, (world.K1, world.K2), world.tau, world.theta, strict=True):
        base = _answer(u, tau, theta)
        J.append(base)
        J.append(K * (_answer(u, tau + 0.02, theta) - base) / 0.02)
        J.append(K * (_answer(u, tau, theta + 0.02) - base) / 0.02)
    begin = round(start / H)
    X, e = np.array(J)[:, begin::10], driven.noise[begin::10]
    n = min(X.shape[1], len(usable))
    X, e, use = X[:, :n], e[:n], usable[:n]
    past = np.array([e[ORDER - i : n - i] for i in range(1, ORDER + 1)])
    ar = np.linalg.lstsq(past.T, e[ORDER:], rcond=None)[0]
    variance = float(np.mean((e[ORDER:] - ar @ past) ** 2))
    white = X[:, ORDER:] - sum(a * X[:, ORDER - i : n - i] for i, a in enumerate(ar, 1))
    white = white[:, use[ORDER:]]
    white -= white.mean(axis=1, keepdims=True)
    information = white @ white.T / variance
    C = np.linalg.inv(information + np.diag([0.0, 1.3, 8.0] * 2))
    sums = [np.array([0, 1, 1, 0, 0, 0.0]), np.array([0, 0, 0, 0, 1, 1.0])]
    return {
        "K1": C[0, 0] ** 0.5,
        "K2": C[3, 3] ** 0.5,
        "tau2": C[4, 4] ** 0.5,
        "theta2": C[5, 5] ** 0.5,
        "sum1": float(sums[0] @ C @ sums[0]) ** 0.5,
        "sum2": float(sums[1] @ C @ sums[1]) ** 0.5,
    }
