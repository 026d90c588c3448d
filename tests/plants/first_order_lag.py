"""The textbook driver: K e^(-theta s) / (1 + tau s), solved exactly for an input that is joined by straight lines.

Written apart from canid's own (`canid.mathematics.identification.first_order`), which it judges.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter


def answer(u: np.ndarray, dt: float, tau: float, dead_time: float) -> np.ndarray:
    """Answer (n,) of unit gain to the input (n,), at rest before it.

    >>> u = np.minimum(np.arange(100) * 0.01, 0.3)  # a ramp that ends
    >>> float(answer(u, 0.01, 1e-4, 0.305)[80].round(3))
    0.3
    """
    alpha = math.exp(-dt / tau)
    # of tau x' + x = u over one step of a straight line
    g = 1.0 - tau / dt * (1.0 - alpha)
    v = np.zeros(len(u))
    v[1:] = (1.0 - alpha) * (u[:-1] - u[0]) + g * np.diff(u)
    x = u[0] + lfilter([1.0], [1.0, -alpha], v)
    back = math.ceil(dead_time / dt - 1e-9)
    s = back * dt - dead_time  # t - dead_time lies s after a sample
    if s > 0.0:
        beta = math.exp(-s / tau)
        slope = np.diff(u, append=u[-1]) / dt
        x = beta * x + (1.0 - beta) * u + slope * (s - tau * (1.0 - beta))
    return np.concatenate([np.full(min(back, len(u)), u[0]), x[: max(len(u) - back, 0)]])
