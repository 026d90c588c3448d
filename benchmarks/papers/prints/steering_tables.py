"""Poles, zero and DC gain of the printed means, and what the printed standard deviations say without a correlation.

Chen & Ulsoy 2001, Tables 1 and 2: A = 1 + a1 q^-1 + a2 q^-2, B = b1 q^-1 + b2 q^-2, at 0.1 s.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import SIGMAS
from canid.values.types import Array
from canid_study.printed_numbers import DC_GAIN_RANGE, STEERING_INTERVAL_S, SteeringTable
from canid_study.systems import control_systems
from canid_study.systems.control_systems import Complex, System

# a share of 30 % is known to 0.1 %
DRAWS = 200_000
# half a unit of the last digit of the tables
HALF_DIGIT = 0.5e-4
# of the DC gain's distribution
PERCENTILES = (5.0, 50.0, 95.0)


class MeanModel(NamedTuple):
    """The model of the printed means."""

    poles_z: tuple[float, ...]  # larger first
    poles_s: tuple[float, ...]  # 1/s, log(z) / T
    zero_z: float
    zero_s: float  # 1/s
    dc_gain: float
    dc_gain_rounding: tuple[float, float]  # over all numbers that would be printed alike


class IndependentDraws(NamedTuple):
    """Models drawn with the printed standard deviations and no correlation."""

    poles: npt.NDArray[np.complex128]  # (n, 2) in z
    dc_gain: Array  # (n,)
    unstable: float  # shares
    complex_poles: float
    negative_real: float
    zero_inside: float  # 0 < zero < 1
    kept_dc_percentiles: tuple[float, float, float]  # of stable models without a negative real pole
    kept_dc_share: float  # of those within `DC_GAIN_RANGE`


class Correlation(NamedTuple):
    """What the standard deviations of b1 and b2 need to agree with the printed range of the DC gain."""

    sd_of_sum_independent: float  # of b1 + b2
    sd_of_sum_least: float  # of any correlation
    sd_of_sum_needed: float  # for 95 % of the DC gains within `DC_GAIN_RANGE`, A at its mean
    corr_needed: float


def roots(a1: Array, a2: Array) -> npt.NDArray[np.complex128]:
    """Both roots of z^2 + a1 z + a2, the larger real part first.

    >>> roots(np.array([-1.3]), np.array([0.4])).round(9)
    array([[0.8+0.j, 0.5+0.j]])
    """
    root = np.sqrt(np.asarray(a1**2 - 4.0 * a2, dtype=np.complex128))
    out: npt.NDArray[np.complex128] = np.stack([(-a1 + root) / 2.0, (-a1 - root) / 2.0], axis=-1)
    return out


def mean_model(table: SteeringTable) -> MeanModel:
    """Poles, zero and DC gain of the means, by z = e^(sT).

    Example:
        >>> from canid_study.printed_numbers import STEERING_TABLES
        >>> m = mean_model(STEERING_TABLES[0])
        >>> [round(p, 3) for p in m.poles_s], round(m.zero_s, 4), round(m.dc_gain, 3)
        ([-2.226, -7.724], -0.2456, 0.934)
    """
    a1, a2, b1, b2 = table.mean
    poles = tuple(float(p) for p in roots(np.array([a1]), np.array([a2]))[0].real)
    zero = -b2 / b1
    ends = [
        _dc_gain(*(x + d for x, d in zip(table.mean, signs, strict=True)))
        for signs in itertools.product((-HALF_DIGIT, HALF_DIGIT), repeat=4)
    ]
    return MeanModel(
        poles,
        tuple(math.log(p) / STEERING_INTERVAL_S for p in poles),
        zero,
        math.log(zero) / STEERING_INTERVAL_S,
        _dc_gain(*table.mean),
        (min(ends), max(ends)),
    )


def driver_system(table: SteeringTable) -> System:
    """G_d = (b1 z + b2) / (z^2 + a1 z + a2) of the means: B/A of eq. 3, sampled.

    >>> from canid_study.printed_numbers import STEERING_TABLES
    >>> driver_system(STEERING_TABLES[0]).num
    (4.134, -4.0337)
    """
    a1, a2, b1, b2 = table.mean
    return System((b1, b2), (1.0, a1, a2), STEERING_INTERVAL_S)


def driver_response(table: SteeringTable, omega: Array) -> Complex:
    """G_d of the means over the frequencies omega (n,) in rad/s, in the printed unit per meter."""
    return control_systems.frequency_response(driver_system(table), omega)


def independent_draws(table: SteeringTable, seed: int, draws: int = DRAWS) -> IndependentDraws:
    """Monte Carlo of the printed means and standard deviations, normal and independent.

    Args:
        table: one of the four.
        seed: of the draws.
        draws: how many.
    """
    rng = np.random.default_rng(seed)
    a1, a2, b1, b2 = (m + s * rng.standard_normal(draws) for m, s in zip(table.mean, table.sd, strict=True))
    poles = roots(a1, a2)
    dc = (b1 + b2) / (1.0 + a1 + a2)
    zero = -b2 / b1
    is_complex = a1**2 < 4.0 * a2
    unstable = np.abs(poles).max(axis=1) >= 1.0
    negative = ~is_complex & (poles.real.min(axis=1) < 0.0)
    kept = dc[~unstable & ~negative]
    low, mid, high = (float(x) for x in np.percentile(kept, PERCENTILES))
    return IndependentDraws(
        poles,
        dc,
        float(unstable.mean()),
        float(is_complex.mean()),
        float(negative.mean()),
        float(((zero > 0.0) & (zero < 1.0)).mean()),
        (low, mid, high),
        float(((kept > DC_GAIN_RANGE[0]) & (kept < DC_GAIN_RANGE[1])).mean()),
    )


def correlation_needed(table: SteeringTable) -> Correlation:
    """The correlation of b1 and b2 with which the DC gain has its printed range.

    Example:
        >>> from canid_study.printed_numbers import STEERING_TABLES
        >>> round(correlation_needed(STEERING_TABLES[0]).corr_needed, 5)
        -0.99996
    """
    a1, a2, _, _ = table.mean
    s1, s2 = table.sd[2:]
    needed = (DC_GAIN_RANGE[1] - DC_GAIN_RANGE[0]) / (2.0 * SIGMAS) * (1.0 + a1 + a2)
    return Correlation(
        math.hypot(s1, s2), abs(s1 - s2), needed, (needed**2 - s1**2 - s2**2) / (2.0 * s1 * s2)
    )


def _dc_gain(a1: float, a2: float, b1: float, b2: float) -> float:
    return (b1 + b2) / (1.0 + a1 + a2)
