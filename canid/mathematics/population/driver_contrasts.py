"""Differences between two groups of drives within each driver who drives both, and their mean over drivers.

A setting may act on one driver more than on another (an interaction, a random slope): the error of the mean difference is
the scatter of the drivers' own differences, with as many degrees of freedom as drivers less one, however many drives there
are (Knapp & Hartung 2003).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, QUANTILES
from canid.mathematics.population.drive_table import Flags, Index
from canid.mathematics.population.pooled_causes import random_effects_mean
from canid.values.types import NAN, Array, Interval


class MeanContrast(NamedTuple):
    """Of one parameter."""

    difference: Interval  # second group less first
    p_value: float  # that its mean over drivers is 0; NaN: fewer than two drivers know both
    drivers: int  # who know both


def mean_contrast(
    y: Array, variance: Array, known: Flags, driver: Index, second: Flags, here: Flags
) -> MeanContrast:
    """Compare two groups of drives.

    Args:
        y: (n,) estimates of one parameter.
        variance: (n,) of each about its driver's mean in the group.
        known: (n,).
        driver: (n,).
        second: (n,) drives of the second group.
        here: (n,) drives of either group.

    Example:
        >>> y, driver = np.array([0.0, 1.0, 2.0, 3.1, 4.0, 5.0]), np.array([0, 0, 1, 1, 2, 2])
        >>> ones = np.ones(6, dtype=bool)
        >>> compared = mean_contrast(y, np.full(6, 0.01), ones, driver, np.arange(6) % 2 == 1, ones)
        >>> compared.drivers, round(compared.difference.value, 2), compared.p_value < 0.02
        (3, 1.03, True)
    """
    differences: list[Interval] = []
    for label in np.unique(driver[known & here]):
        of_driver = known & here & (driver == label)
        sides = [_mean(y, variance, of_driver & side) for side in (~second, second)]
        if any(math.isnan(mean) for mean, _ in sides):
            continue
        (a, va), (b, vb) = sides
        half = NORMAL_QUANTILE * math.sqrt(va + vb)
        differences.append(Interval(b - a, b - a - half, b - a + half))
    if len(differences) < 2:
        return MeanContrast(Interval(), NAN, len(differences))
    return _tested(differences)


def _mean(y: Array, variance: Array, chosen: Flags) -> tuple[float, float]:
    if not chosen.any():
        return NAN, NAN
    weight = 1.0 / np.maximum(variance[chosen], 1e-300)
    return float(weight @ y[chosen] / weight.sum()), float(1.0 / weight.sum())


def _tested(differences: Sequence[Interval]) -> MeanContrast:
    mean, _ = random_effects_mean(differences)
    freedom = len(differences) - 1
    sd = (mean.high - mean.value) / float(stdtrit(freedom, QUANTILES[1]))
    return MeanContrast(
        mean, 2.0 * float(stdtr(freedom, -abs(mean.value) / max(sd, 1e-300))), len(differences)
    )
