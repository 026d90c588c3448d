"""Best percentage of fit at which a printed first-order model is a reduction, over all input spectra (linear programme).

The conditions that K and tau are a least-squares point are linear in the input's power, and so is the squared error:
what the best fit is over every spectrum that there is, is a linear programme in the power at each frequency.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from canid.values.types import Array
from canid_study.printed_numbers import FirstOrder
from canid_study.systems.control_systems import Complex

# rad/s: from a detrended record of 2 min to 9.5 Hz. Twice the points change the best fit by less than 0.01 %
OMEGA = np.geomspace(0.05, 60.0, 1500)


class ReductionBound(NamedTuple):
    """The most favourable input for a first-order model to be the reduction of a system."""

    fit_percent: float  # NaN: no spectrum over these frequencies makes the model a reduction
    lines: tuple[tuple[float, float], ...]  # Hz, and share of the output's power, of that input


def best_fit(response: Complex, model: FirstOrder, omega: Array = OMEGA) -> ReductionBound:
    """Largest fit over all input spectra for which the model is stationary.

    Args:
        response: (n,) of the system.
        model: K and tau.
        omega: (n,) rad/s, at which the input may have power.

    Example: the model itself is its own reduction for any input.
        >>> g = 3.0 / (1.0 + 0.2j * OMEGA)
        >>> round(best_fit(g, FirstOrder("", 3.0, 0.2)).fit_percent, 4)
        100.0
    """
    shape = 1.0 / (1.0 + 1j * omega * model.tau)
    error = response - model.K * shape
    power = np.abs(response) ** 2
    # unknown: the share of the output's power at each frequency
    by_gain = (error * np.conj(shape)).real / power
    by_lag = (error * np.conj(1j * omega * model.K * shape**2)).real / power
    rows = np.array([_scaled(by_gain), _scaled(by_lag), np.ones(len(omega))])
    found = linprog(np.abs(error) ** 2 / power, A_eq=rows, b_eq=[0.0, 0.0, 1.0], method="highs")
    if not found.success:
        return ReductionBound(math.nan, ())
    share: Array = found.x
    lines = tuple((float(omega[i] / (2.0 * math.pi)), float(share[i])) for i in np.flatnonzero(share > 1e-9))
    return ReductionBound(100.0 * (1.0 - math.sqrt(max(float(found.fun), 0.0))), lines)


def _scaled(row: Array) -> Array:
    """A condition of size 1, so that the solver's tolerance is relative."""
    largest = float(np.abs(row).max())
    return row / largest if largest else row
