"""The lattice that rounded readings lie on, and the variance of rounding to it."""

from __future__ import annotations

import numpy as np

from canid.values.types import Array

# of a step, by which a float may be off its lattice
LATTICE_ROUNDING = 0.02
# of a unit; finer decimals are the rounding of floats
DECIMALS = 1e-9


def lattice_step(value: Array) -> float:
    """Step of the lattice that readings lie on; 0: on none, or on one too fine to matter.

    Args:
        value: (n,) finite.

    >>> lattice_step(np.array([0.1, 0.1, 0.3, 0.2])), lattice_step(np.array([0.1, 0.13, 0.25, 0.9]))
    (0.1, 0.0)
    """
    apart = np.diff(np.unique(value))
    apart = apart[apart > 1e-9 * max(float(np.abs(value).max(initial=0.0)), 1e-300)]
    if not len(apart):
        return 0.0
    step = float(apart.min())
    off = np.abs(apart / step - np.round(apart / step))
    # values on no lattice have all distances; a sum of two rounded signals a finer one
    return round(step, 12) if bool((off < LATTICE_ROUNDING).all()) and len(apart) >= 2 else 0.0


def decimals_step(value: Array) -> float:
    """Largest number that all readings are lie apart by multiples of (greatest common divisor), to a billionth.

    Readings on a line rarely show a lattice, and their decimals do.

    Args:
        value: (n,) finite.

    >>> round(decimals_step(np.array([0.1, 0.1333, 0.1667, 0.2])), 9)
    0.0001
    """
    return DECIMALS * float(np.gcd.reduce(np.rint(np.diff(value) / DECIMALS).astype(np.int64)))


def variance(value: Array) -> float:
    """Variance of a uniform rounding error (Widrow & Kollar 2008); 0 where the readings are on no lattice.

    Args:
        value: (n,) readings; NaN where there is none.

    >>> round(variance(np.array([0.0, 0.2, 0.4, 1.0])), 6), variance(np.array([0.0, 0.13, 0.7]))
    (0.003333, 0.0)
    """
    return lattice_step(value[np.isfinite(value)]) ** 2 / 12.0
