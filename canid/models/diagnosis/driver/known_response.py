"""The response to a motion that is known the better the longer ago it was: each instant by all that is known at present.

A driver with dead time θ and lag τ responds to Σ h(s) x(t − s). What is known at t of x(t − s) is the conditional mean
given the reports up to t (`causal_smoothing.py`). Filtering x(t' − θ) as it was known at each t' uses less: its errors are
found out by t, so that they are no longer independent of what is known, and bend gain and delays. Of a position or a speed
that a radar reports there is hardly such an error; an acceleration is known with 0.15 m/s² at once and 0.08 m/s² after
0.4 s (of 0.5 m/s²): on 12 planted drives the response to it came out a tenth too small, by up to half.

What is fitted is whitened: the innovation at t is that of A(q) y, and of x(t − s) in A(q) Σ h(s) x(t − s) all that is known
at t counts as well. The filters are therefore joined, and the response is what A(q) makes that of.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from canid.values.types import Array

# a noise model without memory
WHITE = np.ones(1)
# samples between the dead time and the last lag at which x is known, from which on this differs from delaying x
LEAST_LAGS = 3


def known_response(lags: Array, theta: float, tau: float, dt: float, A: Array = WHITE) -> Array | None:
    """Return x behind a dead time and a lag, each instant as it is known at present; None: the dead time is too long.

    Args:
        lags: (n, k) column j holds x(t − j·dt) as known at t.
        theta: s, dead time.
        tau: s, lag; 0: none.
        dt: s.
        A: (p + 1,) the noise model that the response is fitted with, A[0] = 1.

    Returns:
        (n,) in the unit of x.

    Example:
        >>> lags = np.ones((50, 8))
        >>> float(known_response(lags, 0.2, 0.3, 0.1)[0])
        1.0
        >>> known_response(lags, 0.7, 0.3, 0.1) is None
        True
    """
    k, p = lags.shape[1], len(A) - 1
    if theta / dt >= k - LEAST_LAGS:
        return None
    h, decay = _impulse(theta, tau, dt, k + p + 1)
    joined = np.convolve(A, h)[: k + p + 1]
    # it was at rest before; taken from the sum and not from each lag, whose copy would cost as much as all the rest
    rest = lags[0, 0]
    oldest = lags[:, k - 1] - rest
    out = lags[:, : k - 1] @ joined[: k - 1] - rest * float(joined[: k - 1].sum())
    out += lfilter(joined[k - 1 : k + p], [1.0], oldest)
    if decay > 0.0:
        # from here on the joined response falls as the lag's own
        later = np.r_[np.zeros(p + 1), oldest[: -(p + 1)]]
        out += lfilter([joined[k + p]], [1.0, -decay], later)
    response: Array = rest + lfilter([1.0], A, out)
    return response


def _impulse(theta: float, tau: float, dt: float, size: int) -> tuple[Array, float]:
    """Response to one sample of 1, straight between samples, and the factor by which it falls per step."""
    steps = theta / dt
    whole = math.floor(steps)
    h = np.zeros(size)
    h[whole : whole + 2] = 1.0 - (steps - whole), steps - whole
    if tau <= 0.0:
        return h, 0.0
    decay = math.exp(-dt / tau)
    ramp = tau / dt * (1.0 - decay)
    return lfilter([1.0 - ramp, ramp - decay], [1.0, -decay], h), decay
