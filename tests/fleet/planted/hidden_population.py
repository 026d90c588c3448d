"""Hierarchical log-normal population of drivers: driver = law + between, drive = driver + within (all in logarithms).

Written without anything of canid's population model, which it judges: gains are skewed, and drivers of two groups differ.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Person(NamedTuple):
    """What one person does in one drive: both answers with a lag in common, K e^(-dead_time s) / (1 + tau s)."""

    K1: float  # % per s of headway error
    K2: float  # % per m/s
    tau: float  # s
    dead_time1: float  # s
    dead_time2: float  # s
    headway_desired: float  # s
    noise_sd: float  # %


# gains and times within those of Grover's driver (2021, Tables 1 and 2) and of reactions in traffic
MEDIAN = Person(6.0, 5.6, 0.45, 0.36, 0.30, 1.9, 1.8)
# standard deviations of the logarithms. Between people: gains of one car's drivers differ by a factor of 1.5 to 2
BETWEEN = Person(0.20, 0.22, 0.28, 0.22, 0.22, 0.12, 0.25)
# between drives of one person: mood, traffic, tiredness
WITHIN = Person(0.08, 0.08, 0.12, 0.10, 0.10, 0.05, 0.10)
# of the logarithms between people: who follows firmly does so in both answers and is prompt
CORRELATION = np.array(
    [
        [1.0, 0.6, -0.2, -0.1, -0.2, -0.3, 0.1],
        [0.6, 1.0, -0.3, -0.2, -0.3, -0.2, 0.2],
        [-0.2, -0.3, 1.0, 0.3, 0.3, 0.1, 0.0],
        [-0.1, -0.2, 0.3, 1.0, 0.6, 0.2, 0.0],
        [-0.2, -0.3, 0.3, 0.6, 1.0, 0.2, 0.0],
        [-0.3, -0.2, 0.1, 0.2, 0.2, 1.0, 0.0],
        [0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
# logarithm that the second group has more of each
GROUP_SHIFT = Person(0.0, 0.30, 0.0, 0.0, 0.0, 0.20, 0.0)
# standard deviations: beyond them a linear driver runs into the lead
MOST_SD = 2.2
# draws of a mean by Monte Carlo: its error is 1 % of a standard deviation
DRAWS = 20_000

# pooled parameter -> its value of the columns of `Person`
VALUES: dict[str, Callable[[Array], Array]] = {
    "headway_error.K": lambda x: x[..., 0],
    "range_rate.K": lambda x: x[..., 1],
    "headway_error.log_tau": lambda x: np.log(x[..., 2]),
    "range_rate.log_tau": lambda x: np.log(x[..., 2]),
    "headway_error.dead_time": lambda x: x[..., 3],
    "range_rate.dead_time": lambda x: x[..., 4],
    "headway_error.log_tau_plus_dead_time": lambda x: np.log(x[..., 2] + x[..., 3]),
    "range_rate.log_tau_plus_dead_time": lambda x: np.log(x[..., 2] + x[..., 4]),
    "log_noise_sd": lambda x: np.log(x[..., 6]),
    "log_wanted_headway": lambda x: np.log(x[..., 5]),
}


class Spread(NamedTuple):
    """Of one parameter: mean over people, standard deviation between people and between drives of one person."""

    mean: float
    between: float
    within: float


def people(n: int, rng: np.random.Generator) -> Array:
    """Draw people: (n, 7) logarithms of `Person`, without a group's shift.

    Example:
        >>> people(30, np.random.default_rng(1)).shape
        (30, 7)
    """
    z = np.clip(rng.standard_normal((n, len(MEDIAN))), -MOST_SD, MOST_SD)
    out: Array = np.log(np.array(MEDIAN)) + (z @ np.linalg.cholesky(CORRELATION).T) * np.array(BETWEEN)
    return out


def shifted(people: Array, second: npt.NDArray[np.bool_]) -> Array:
    """Add the shift of the second group to its people, (n, 7)."""
    out: Array = people + second[:, None] * np.array(GROUP_SHIFT)
    return out


def drives(person: Array, n: int, rng: np.random.Generator) -> Array:
    """Draw drives of one person: (n, 7) as `Person`.

    Args:
        person: (7,) logarithms.
        n: number of drives.
        rng: source of random numbers.
    """
    e = np.clip(rng.standard_normal((n, len(MEDIAN))), -MOST_SD, MOST_SD)
    out: Array = np.exp(person + e * np.array(WITHIN))
    return out


def expected(person: Array, seed: int = 1) -> dict[str, float]:
    """Means of the parameters over all drives that a person might drive.

    Example:
        >>> round(float(np.exp(expected(np.log(np.array(MEDIAN)))["log_wanted_headway"])), 1)
        1.9
    """
    x = drives(person, DRAWS, np.random.default_rng(seed))
    return {name: float(value(x).mean()) for name, value in VALUES.items()}


def spreads(second_share: float, seed: int = 2) -> dict[str, Spread]:
    """Spreads of the population.

    Args:
        second_share: of people in the second group, with its shift; 0: no group differs.
        seed: of the Monte Carlo.

    Example:
        >>> of = spreads(0.0)["range_rate.K"]
        >>> 5.5 < of.mean < 6.0, 1.1 < of.between < 1.5, 0.4 < of.within < 0.5
        (True, True, True)
    """
    rng = np.random.default_rng(seed)
    drawn = people(DRAWS, rng)
    drawn = shifted(drawn, rng.uniform(size=DRAWS) < second_share)
    # few drives of each of many people: the law of total variance, without bias
    n = 8
    e = np.clip(rng.standard_normal((n, *drawn.shape)), -MOST_SD, MOST_SD)
    x = np.exp(drawn + e * np.array(WITHIN))
    out = {}
    for name, value in VALUES.items():
        y = value(x)
        within = float(y.var(axis=0, ddof=1).mean())
        between = float(y.mean(axis=0).var(ddof=1)) - within / n
        out[name] = Spread(float(y.mean()), between**0.5, within**0.5)
    return out
