"""Exact response of a first-order lag with dead time, e^(-theta s) / (1 + tau s), to piecewise linear inputs.

Inputs that come from a vehicle are samples of something continuous, so they are joined by straight lines
(first-order hold); with that the dead time may be any fraction of a sample: holding them instead costs half a
sample of dead time. The recursion is that of the exact solution of tau x' + x = u over one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.first_order import scan
from canid.values.types import Array


class Response(NamedTuple):
    """The response and its gradient."""

    x: Array  # (n,) in the input's unit
    d_tau: Array  # (n,) per s
    d_dead_time: Array  # (n,) per s


def _pieces(n: int, starts: Sequence[int]) -> list[tuple[int, int]]:
    edges = sorted({0, *starts, n})
    return [(a, b) for a, b in pairwise(edges) if b > a]


def lags(u: Array, dt: float, taus: Array, starts: Sequence[int] = ()) -> Array:
    """Answers without dead time of several lags at once.

    Args:
        u: (n,) input, finite.
        dt: s.
        taus: (m,) s, positive.
        starts: indices where the history begins anew: there the lag is at rest at the input's value.

    Returns:
        (m, n).

    >>> lags(np.array([0.0, 0.0, 1.0, 1.0, 1.0]), 1.0, np.array([1e-3])).round(2)
    array([[0., 0., 1., 1., 1.]])
    """
    tau = np.asarray(taus, float)[:, None]
    alpha = np.exp(-dt / tau)
    g = 1.0 - tau / dt * (1.0 - alpha)
    out = np.empty((len(tau), len(u)))
    for a, b in _pieces(len(u), starts):
        w = u[a:b] - u[a]  # deviation from rest: then the state starts at zero
        v = np.zeros((len(tau), b - a))
        v[:, 1:] = (1.0 - alpha) * w[:-1] + g * np.diff(w)
        out[:, a:b] = u[a] + scan(v, alpha)
    return out


def _whole_and_rest(dead_time: float, dt: float) -> tuple[int, float]:
    """t_k - dead_time = t_(k-d-1) + s with 0 < s <= dt."""
    # 1e-12: a dead time of three samples is three samples, whatever its last bit says
    d = int(np.floor(dead_time / dt + 1e-12))
    return d, dt - (dead_time - d * dt)


def _back(x: Array, d: int) -> Array:
    """Delay x by d samples, held at its first value before."""
    if d <= 0:
        return x
    out = np.empty_like(x)
    out[..., d:] = x[..., : max(x.shape[-1] - d, 0)]
    out[..., :d] = x[..., :1]
    return out


def delayed(u: Array, x: Array, dt: float, tau: float, dead_times: Array) -> Array:
    """From a lag's answer `x` (n,) on the grid to its answers (m, n) at t - dead_time, exact between samples.

    Across a restart of history the first samples still show the older piece; a fit drops them.
    """
    n = len(u)
    out = np.empty((len(dead_times), n))
    du = np.empty(n)
    du[0], du[1:] = 0.0, np.diff(u)
    u1, x1 = _back(u, 1), _back(x, 1)
    away = x1 - u1
    for row, dead_time in zip(out, dead_times, strict=True):
        d, s = _whole_and_rest(float(dead_time), dt)
        beta = np.exp(-s / tau)
        h = (s - tau * (1.0 - beta)) / dt
        m = max(n - d, 0)
        np.multiply(away[:m], beta, out=row[d:])
        row[d:] += u1[:m]
        row[d:] += h * du[:m]
        row[:d] = u[0]
    return out


def response(u: Array, dt: float, tau: float, dead_time: float, starts: Sequence[int] = ()) -> Response:
    """Answer `u`, with its exact gradient by tau and dead time.

    Args:
        u: (n,) input, finite.
        dt: s.
        tau: s, positive.
        dead_time: s, not negative.
        starts: indices where the history begins anew.

    Raises:
        ValueError: tau or dead time out of range.

    >>> r = response(np.ones(4), 0.1, 0.5, 0.25)
    >>> r.x
    array([1., 1., 1., 1.])
    """
    if not tau > 0.0 or not dead_time >= 0.0:
        raise ValueError(f"tau = {tau} must be positive and dead_time = {dead_time} not negative")
    x = lags(u, dt, np.array([tau]), starts)[0]
    alpha = np.exp(-dt / tau)
    d_alpha = alpha * dt / tau**2
    dg = -(1.0 - alpha) / dt + tau / dt * d_alpha
    sx = np.zeros(len(u))
    for a, b in _pieces(len(u), starts):
        v = np.zeros(b - a)
        v[1:] = (x[a : b - 1] - u[a : b - 1]) * d_alpha + dg * np.diff(u[a:b])
        sx[a:b] = scan(v, np.array([alpha]))
    d, s = _whole_and_rest(dead_time, dt)
    beta = np.exp(-s / tau)
    d_beta = beta * s / tau**2
    dh = (-(1.0 - beta) + tau * d_beta) / dt
    y = delayed(u, x, dt, tau, np.array([dead_time]))[0]
    du = np.empty(len(u))
    du[0], du[1:] = 0.0, np.diff(u)
    u1, x1, sx1 = _back(u, 1), _back(x, 1), _back(sx, 1)
    sx1[0] = 0.0
    d_tau = _back(beta * sx1 + (x1 - u1) * d_beta + dh * du, d)
    d_tau[:d] = 0.0
    now = _back(u1 + du * (s / dt), d)
    return Response(y, d_tau, -(now - y) / tau)
