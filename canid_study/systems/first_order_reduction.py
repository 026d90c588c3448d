"""Least-squares reduction of a system to first order, with or without dead time, for a given input spectrum."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.values.types import Array
from canid_study.systems.control_systems import Complex


class FirstOrderFit(NamedTuple):
    """The first-order model nearest to another one for an input of given spectrum."""

    K: float
    tau: float  # s
    dead_time: float  # s
    fit_percent: float  # 100 (1 - rms of the difference / rms of the output)


def first_order_reduction(
    omega: Array, response: Complex, weight: Array, *, dead_time: bool = False, largest: float = 10.0
) -> FirstOrderFit:
    """Least-squares first-order model of a response for an input of a given spectrum.

    Minimises sum weight |G - K e^(-theta s) / (1 + tau s)|^2, which is what an output-error fit of the model to noise-free
    records tends to (Ljung 1999, sec. 8.5). K is linear and follows by projection; tau and theta are searched from a grid.

    Args:
        omega: (n,) rad/s.
        response: (n,) G(j omega).
        weight: (n,) power of the input at each frequency, times the frequency spacing.
        dead_time: also fit theta (P1D); otherwise it is 0 (P1).
        largest: s, of tau and theta.

    >>> from canid_study.systems.control_systems import first_order, frequency_response
    >>> w = np.linspace(0.01, 6.0, 300)
    >>> fit = first_order_reduction(w, frequency_response(first_order(4.0, 0.5, 0.3), w), np.ones(300), dead_time=True)
    >>> [round(x, 3) for x in fit]
    [4.0, 0.5, 0.3, 100.0]
    """
    from scipy.optimize import minimize

    power = float(np.sum(weight * np.abs(response) ** 2))

    def explained(x: Array) -> tuple[Array, Array]:
        """Share of the power explained, and K; x (..., 2) of tau and theta."""
        tau, theta = x[..., :1], x[..., 1:]
        shape = np.exp(-1j * omega * theta) / (1.0 + 1j * omega * tau)
        inner = np.sum(weight * (np.conj(shape) * response).real, axis=-1)
        norm = np.sum(weight * np.abs(shape) ** 2, axis=-1)
        return inner**2 / norm / power, inner / norm

    # 0, then closer together towards it: the response depends on log tau
    tried = np.concatenate([[0.0], np.geomspace(1e-3, largest, 40)])
    thetas = tried[::2] if dead_time else np.zeros(1)
    grid = np.stack(np.meshgrid(tried, thetas, indexing="ij"), axis=-1).reshape(-1, 2)
    # a row at a time: 800 of 3,000 frequencies would be 40 MB
    share = np.array([explained(row)[0] for row in grid])
    # the best few: the criterion has several minima where G has resonances
    best, at = -1.0, grid[0]
    bounds = [(0.0, largest), (0.0, largest if dead_time else 0.0)]
    for start in grid[np.argsort(share)[::-1][:3]]:
        minimum = minimize(
            lambda x: 1.0 - float(explained(x)[0]),
            start,
            bounds=bounds,
            method="Nelder-Mead",
            options={"xatol": 1e-10, "fatol": 1e-14, "maxiter": 4000, "maxfev": 4000},
        )
        if 1.0 - minimum.fun > best:
            best, at = 1.0 - float(minimum.fun), np.asarray(minimum.x)
    K = float(explained(at)[1])
    return FirstOrderFit(K, float(at[0]), float(at[1]), 100.0 * (1.0 - math.sqrt(max(1.0 - best, 0.0))))
