"""Poles, zeros, gain, damping and stability of the printed transfer functions (Grover 2021, eq. 2.4 and 2.5)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array
from canid_study.printed_numbers import TransferFunction
from canid_study.systems import control_systems
from canid_study.systems.control_systems import Complex, System

# draws within the last printed digit: a share of 0 in 5,000 is below 0.06 % with 95 % confidence
ROUNDING_DRAWS = 5000
# the coefficients are printed by %.4g
SIGNIFICANT_DIGITS = 4


class Properties(NamedTuple):
    """What a transfer function is."""

    poles: Complex  # 1/s, falling real part
    zeros: Complex  # 1/s
    dc_gain: float
    frequency_hz: Array  # (n,) of each pole
    damping: Array  # (n,) of each pole, negative: growing

    @property
    def unstable(self) -> int:
        """Number of growing poles.

        >>> Properties(np.array([0.1 + 1j, -2]), np.array([]), 1.0, np.zeros(2), np.zeros(2)).unstable
        1
        """
        return int(np.count_nonzero(self.poles.real > 0.0))


def system(printed: TransferFunction) -> System:
    """The printed transfer function for python-control.

    >>> from canid_study.printed_numbers import EQ_2_4
    >>> system(EQ_2_4).den
    (1.0, 4.926, 432.5, 617.5, 10760.0)
    """
    return System(printed.num, printed.den)


def properties(printed: TransferFunction) -> Properties:
    """Poles, zeros, DC gain and damping by python-control.

    Example:
        >>> from canid_study.printed_numbers import EQ_2_4, EQ_2_5
        >>> round(properties(EQ_2_4).dc_gain, 4), round(properties(EQ_2_5).dc_gain, 1)
        (2.3178, -1033.9)
        >>> properties(EQ_2_4).unstable, properties(EQ_2_5).unstable
        (0, 6)
    """
    g = system(printed)
    damping = control_systems.damping(g)
    order = np.lexsort((damping.poles.imag, -damping.poles.real.round(9)))
    return Properties(
        damping.poles[order],
        control_systems.zeros(g),
        control_systems.dc_gain(g),
        damping.natural_frequency[order] / (2.0 * math.pi),
        damping.ratio[order],
    )


def growth(printed: TransferFunction, seconds: float) -> float:
    """Factor by which an error of the initial state grows: e^(largest real part * seconds).

    >>> growth(TransferFunction("", (1.0,), (1.0, -0.5), 0.0), 2.0) == math.exp(1.0)
    True
    """
    return math.exp(max(float(p.real) for p in properties(printed).poles) * seconds)


def roots_of_many(den: Array) -> Complex:
    """Roots of many polynomials as eigenvalues of their companion matrices.

    Args:
        den: (k, n + 1) falling powers, the first not 0.

    Returns:
        (k, n).

    Example:
        >>> np.sort(roots_of_many(np.array([[1.0, 3.0, 2.0], [2.0, 0.0, -8.0]])).real).round(9)
        array([[-2., -1.],
               [-2.,  2.]])
    """
    monic = den[:, 1:] / den[:, :1]
    n = monic.shape[1]
    # s = scale x, so that the powers of one row are of one size and the eigenvalues accurate
    scale = np.maximum(np.abs(monic[:, -1:]), np.finfo(np.float64).tiny) ** (1.0 / n)
    companion = np.zeros((len(den), n, n))
    companion[:, 0, :] = -monic / scale ** np.arange(1, n + 1)
    companion[:, np.arange(1, n), np.arange(n - 1)] = 1.0
    out: Complex = np.linalg.eigvals(companion).astype(np.complex128) * scale
    return out


def unstable_poles(den: Array) -> npt.NDArray[np.int64]:
    """Number of roots with a positive real part, of each polynomial of `den` (k, n + 1)."""
    out: npt.NDArray[np.int64] = np.count_nonzero(roots_of_many(den).real > 0.0, axis=1).astype(np.int64)
    return out


def within_the_last_digit(printed: TransferFunction, draws: int, seed: int) -> npt.NDArray[np.int64]:
    """Unstable poles of transfer functions that would be printed alike.

    Args:
        printed: coefficients with `SIGNIFICANT_DIGITS`.
        draws: how many.
        seed: of the draws, uniform over half a unit of the last digit to each side.

    Returns:
        (draws,) numbers of unstable poles.

    Example:
        >>> from canid_study.printed_numbers import EQ_2_4
        >>> within_the_last_digit(EQ_2_4, 10, 1)
        array([0, 0, 0, 0, 0, 0, 0, 0, 0, 0])
    """
    den = np.array(printed.den)
    unit = 10.0 ** (np.floor(np.log10(np.abs(den))) - (SIGNIFICANT_DIGITS - 1))
    unit[0] = 0.0  # the leading 1 is exact
    rng = np.random.default_rng(seed)
    return unstable_poles(den + unit * rng.uniform(-0.5, 0.5, (draws, len(den))))
