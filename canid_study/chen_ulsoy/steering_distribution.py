"""A joint distribution of a1, a2, b1, b2 that agrees with all that Chen & Ulsoy print: Tables 1, 2 and Fig. 12.

Two real poles in (0, 1), logistic of correlated normals; b1 log-normal, correlated with the slow pole's normal; the zero
between -1 and 0 1/s, e^(-T logistic(normal)). Its parameters are fitted to the printed means, standard deviations and
range of the DC gain, so that it is *a* distribution that agrees with the prints; the prints do not fix it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import expit
from scipy.stats import norm, qmc

from canid.values.types import Array
from canid_study.printed_numbers import (
    DC_GAIN_RANGE,
    STEERING_INTERVAL_S,
    ZERO_RANGE,
    SteeringTable,
)

# points of the normal space in the fit: means and standard deviations of 2,048 Sobol points are within 0.5 % of a standard
# deviation of those of two million draws, the ends of the DC gain within 3 %
FIT_POINTS = 2048
# relative errors in the fit: both are printed to 4 digits, but 59 segments know them to some per cent
_MEAN_SCALE, _SD_SCALE = 0.02, 0.02  # of the standard deviation
# "between 0.2 and 2" is read from a scatter plot: its ends as the 5 and 95 % points within a factor of 1.35
_RANGE_SCALE = 0.3


class Parameters(NamedTuple):
    """Of the underlying normals; r and rb correlate pole 2 and b1 with pole 1."""

    m1: float = 1.3
    lns1: float = -0.7
    m2: float = 0.0
    lns2: float = 0.0
    atanh_r: float = -2.0
    mb: float = 1.25
    lnsb: float = -0.7
    mz: float = -1.3
    lnsz: float = -0.2
    atanh_rb: float = 0.3


class Statistics(NamedTuple):
    """What a distribution says of the printed quantities."""

    mean: Array  # (4,)
    sd: Array  # (4,)
    corr: Array  # (4, 4)
    dc_5_50_95: tuple[float, float, float]


def from_normals(parameters: Parameters, x: Array) -> Array:
    """Models of independent standard normals.

    Args:
        parameters: of the distribution.
        x: (4, n).

    Returns:
        (4, n) a1, a2, b1, b2.

    Example:
        >>> from_normals(Parameters(), np.zeros((4, 1))).round(3)[:, 0]
        array([-1.286,  0.393,  3.49 , -3.416])
    """
    p1, p2, b1, zero = _factors(parameters, x)
    out: Array = np.stack([-(p1 + p2), p1 * p2, b1, -zero * b1])
    return out


def draw(parameters: Parameters, rng: np.random.Generator, n: int) -> Array:
    """Draw n models, (4, n).

    >>> draw(Parameters(), np.random.default_rng(1), 3).shape
    (4, 3)
    """
    return from_normals(parameters, rng.standard_normal((4, n)))


def statistics(parameters: Parameters, x: Array) -> Statistics:
    """Means, standard deviations, correlations and percentiles over given standard normals x (4, n)."""
    p1, p2, b1, zero = _factors(parameters, x)
    theta = np.stack([-(p1 + p2), p1 * p2, b1, -zero * b1])
    dc = b1 * (1.0 - zero) / ((1.0 - p1) * (1.0 - p2))
    return Statistics(theta.mean(axis=1), theta.std(axis=1), np.corrcoef(theta), _percentiles(dc))


def fit(table: SteeringTable) -> Parameters:
    """Least-squares fit of the distribution to the means, standard deviations and DC range of a printed table.

    Args:
        table: estimation or validation.

    Example:
        >>> from canid_study.printed_numbers import STEERING_TABLES
        >>> m = statistics(fit(STEERING_TABLES[0]), sobol_normals(FIT_POINTS))
        >>> bool(np.all(np.abs(m.sd / STEERING_TABLES[0].sd - 1.0) < 0.05))
        True
    """
    x = sobol_normals(FIT_POINTS)
    wanted_mean, wanted_sd = np.array(table.mean), np.array(table.sd)
    # near-equal b1 and -b2 hide the zero: their sum and its standard deviation are fitted too
    sum_mean = float(wanted_mean[2] + wanted_mean[3])

    def residual(p: Array) -> Array:
        parameters = Parameters(*p)
        predicted = statistics(parameters, x)
        low, _, high = predicted.dc_5_50_95
        start = np.array(Parameters())
        return np.concatenate(
            [
                (predicted.mean - wanted_mean) / (_MEAN_SCALE * wanted_sd),
                np.log(predicted.sd / wanted_sd) / _SD_SCALE,
                [(predicted.mean[2] + predicted.mean[3] - sum_mean) / (0.05 * abs(sum_mean))],
                np.log(np.array([low, high]) / DC_GAIN_RANGE) / _RANGE_SCALE,
                # a weak pull to the start for what the prints do not fix
                0.02 * (p - start),
            ]
        )

    solution = least_squares(residual, np.array(Parameters()), method="lm", max_nfev=600)
    return Parameters(*(float(v) for v in solution.x))


def sobol_normals(n: int) -> Array:
    """Standard normals (4, n) of a Sobol sequence, n a power of two.

    >>> abs(float(sobol_normals(256).mean())) < 0.01
    True
    """
    sequence = qmc.Sobol(4, scramble=True, rng=np.random.default_rng(7)).random(n)
    out: Array = norm.ppf(sequence).T
    return out


def _factors(q: Parameters, x: Array) -> tuple[Array, Array, Array, Array]:
    r, rb = np.tanh(q.atanh_r), np.tanh(q.atanh_rb)
    second = r * x[0] + np.sqrt(1.0 - r * r) * x[1]
    gain = rb * x[0] + np.sqrt(1.0 - rb * rb) * x[2]
    p1 = expit(q.m1 + np.exp(q.lns1) * x[0])
    p2 = expit(q.m2 + np.exp(q.lns2) * second)
    b1 = np.exp(q.mb + np.exp(q.lnsb) * gain)
    # between 0 and -1 1/s
    zero = np.exp(ZERO_RANGE[0] * STEERING_INTERVAL_S * expit(q.mz + np.exp(q.lnsz) * x[3]))
    return p1, p2, b1, zero


def _percentiles(x: Array) -> tuple[float, float, float]:
    low, mid, high = np.percentile(x, (5.0, 50.0, 95.0))
    return float(low), float(mid), float(high)
