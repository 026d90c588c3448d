"""A driver's own loop, simulated again: his model, his car and his disturbances (parametric bootstrap, Efron 1979).

The car from wheel angle to lateral error is a regression on the past of both, of one car for all segments, whose residual
is the disturbance; each segment has its own size of it. So repetitions keep the feedback, which a simulation with the
measured error as a given input does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.types import Array

# lags of the car: 1 s at 10 Hz, past which a car's yaw and tyres have settled
_LAGS = 10
# standard deviations of a segment that no repetition may leave: a loop that runs away is left out
_RUNAWAY = 20.0


class Car(NamedTuple):
    """Lateral error of wheel angle, as one driver's logs show it."""

    of_error: Array  # (p,) coefficients of the lags 1 to p
    of_angle: Array  # (p + 1,) of the lags 0 to p
    constant: Array  # (S,) of each segment
    sd: Array  # (S,) of each segment's disturbance


def fit_car(angle: Array, error: Array) -> Car | None:
    """Least squares over all segments; None where the angle does not excite them.

    Args:
        angle: (S, N).
        error: (S, N).

    >>> rng = np.random.default_rng(0)
    >>> d, y = rng.normal(size=(4, 300)), np.zeros((4, 300))
    >>> for t in range(1, 300): y[:, t] = 0.9 * y[:, t-1] - 0.5 * d[:, t-1] + 0.01 * rng.normal(size=4)
    >>> car = fit_car(d, y)
    >>> round(float(car.of_error[0]), 1), round(float(car.of_angle[1]), 1)
    (0.9, -0.5)
    """
    p, N = _LAGS, angle.shape[1]
    rows = [error[:, p - k : N - k] for k in range(1, p + 1)]
    rows += [angle[:, p - k : N - k] for k in range(p + 1)]
    X = np.stack(rows, axis=1)
    y = error[:, p:]
    middle, level = X.mean(axis=2, keepdims=True), y.mean(axis=1)
    moved = X - middle
    H = np.einsum("skt,slt->kl", moved, moved, optimize=True)
    g = np.einsum("skt,st->k", moved, y - level[:, None], optimize=True)
    size = np.sqrt(np.diag(H))
    if not (size > 0.0).all():
        return None
    # neighbouring lags are nearly equal: least norm of what the data cannot separate
    w = np.linalg.lstsq(H / np.outer(size, size), g / size, rcond=1e-12)[0] / size
    residual = y - level[:, None] - np.einsum("k,skt->st", w, moved)
    return Car(w[:p], w[p:], level - middle[:, :, 0] @ w, residual.std(axis=1))


def repeat(
    model: Array,
    offset: Array,
    c: Array,
    sigma: Array,
    car: Car,
    angle: Array,
    error: Array,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Simulate every segment once more.

    Args:
        model: (S, 4) a1, a2, b1, b2.
        offset: (S,) c0.
        c: (S,) c1.
        sigma: (S,) of e.
        car: of the same segments.
        angle: (S, N) measured; its first second is where the simulation begins.
        error: (S, N) likewise.
        rng: source of random numbers.

    Returns:
        Angle and error, (S, N) each; NaN where the loop runs away.
    """
    S, N = angle.shape
    p = _LAGS
    d, y = np.zeros((N, S)), np.zeros((N, S))
    d[:p], y[:p] = angle[:, :p].T, error[:, :p].T
    e = sigma * rng.standard_normal((N, S))
    w = car.sd * rng.standard_normal((N, S))
    a1, a2, b1, b2 = model.T
    back_y, back_d = car.of_error[::-1].copy(), car.of_angle[::-1].copy()
    with np.errstate(over="ignore", invalid="ignore"):
        for t in range(p, N):
            d[t] = (
                -a1 * d[t - 1] - a2 * d[t - 2] + b1 * y[t - 1] + b2 * y[t - 2] + offset + e[t] + c * e[t - 1]
            )
            y[t] = back_y @ y[t - p : t] + back_d @ d[t - p : t + 1] + car.constant + w[t]
    limit = _RUNAWAY * np.maximum(np.abs(error).max(axis=1), 1e-12)
    lost = ~(np.abs(y) < limit).all(axis=0) | ~np.isfinite(d).all(axis=0)
    d[:, lost], y[:, lost] = np.nan, np.nan
    return d.T.copy(), y.T.copy()
