"""The least first-order weight above a set of model errors |Delta| (Chen & Ulsoy 2001, eq. 5)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.values.types import Array
from canid_study.systems.control_systems import System


class Envelope(NamedTuple):
    """A first-order weight gain (1 + s / zero) / (1 + s / pole) that lies on or above a set of magnitudes."""

    system: System
    excess_db: float  # mean by which it lies above them


def first_order_envelope(omega: Array, magnitude: Array) -> Envelope:
    """The least first-order weight above a set of magnitudes: least mean of log |W| - log |Delta|.

    This is the form of Chen & Ulsoy 2001, eq. 5: (5 s + 0.5) / (s + 2.5).

    Args:
        omega: (n,) rad/s, above 0.
        magnitude: (n,) largest |Delta| at each frequency; (k, n) of k of them.

    >>> from canid_study.systems.control_systems import frequency_response
    >>> w = np.geomspace(0.05, 20.0, 60)
    >>> wanted = frequency_response(System((5.0, 0.5), (1.0, 2.5)), w)
    >>> envelope = first_order_envelope(w, np.abs(wanted))
    >>> [round(x, 2) for x in envelope.system.num], [round(x, 2) for x in envelope.system.den]
    ([5.0, 0.5], [1.0, 2.5])
    """
    from scipy.optimize import minimize

    omega = np.asarray(omega, dtype=np.float64)
    top = np.log(np.maximum(np.max(np.atleast_2d(magnitude), axis=0), np.finfo(np.float64).tiny))

    def above(x: Array) -> tuple[float, float]:
        """Mean excess and log gain of the weight with log zero and log pole x, raised until it lies above."""
        zero, pole = np.exp(x)
        shape = 0.5 * (np.log1p((omega / zero) ** 2) - np.log1p((omega / pole) ** 2))
        gain = float(np.max(top - shape))
        return float(np.mean(gain + shape - top)), gain

    # a decade past the data's own frequencies on both sides: a corner farther out changes nothing within them
    logs = np.linspace(np.log(omega[0]) - 2.3, np.log(omega[-1]) + 2.3, 24)
    grid = [np.array([zero, pole]) for zero in logs for pole in logs]
    starts = sorted(grid, key=lambda x: above(x)[0])[:4]
    minima = [
        minimize(
            lambda x: above(x)[0],
            start,
            method="Nelder-Mead",
            options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 2000},
        )
        for start in starts
    ]
    best = min(minima, key=lambda r: float(r.fun)).x
    excess, gain = above(best)
    zero, pole = (math.exp(x) for x in best)
    K = math.exp(gain)
    system = System((K * pole / zero, K * pole), (1.0, pole))
    # 20 dB a decade
    return Envelope(system, 20.0 * excess / math.log(10.0))
