"""Evidence of causes across drives: how often a cause is named where it could be, and whether false names explain that.

Drives of one driver are alike, so that their rate has a design effect (Rao & Scott 1992): the interval is the beta one of
Jeffreys (Brown, Cai & DasGupta 2001) for the number of independent drives that are worth as much. The strength is the
random-effects mean of Paule & Mandel (1982) with the interval of Knapp & Hartung (2003), of the drives that name the cause:
where many could not name it, those that do have the larger strengths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import bdtrc, betaincinv, stdtrit

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, QUANTILES
from canid.mathematics.population.false_discovery import RATE, adjusted
from canid.values.types import NAN, Array, Interval

# chance that the diagnosis of a drive names one given cause falsely: of clean simulated drives at most 1.7 % have any false
# name (docs/evidence/diagnosis.md); people do what no simulator does, so three times as many
FALSE_NAMES = 0.05
# drivers below which the design effect is not known
MIN_DRIVERS = 3
# halvings of the bracket of the spread
BISECTIONS = 60


class Diagnosed(NamedTuple):
    """One diagnosed drive and one cause."""

    drive: str
    driver: str
    car: str
    effect: str
    named: bool
    strength: Interval = Interval()  # of the effect's first parameter, where it is named
    detectable: float = (
        NAN  # strength that would have been named 9 times of 10; NaN: the drive cannot name it
    )


class PooledCause(NamedTuple):
    """One cause in the drives of one car."""

    car: str
    effect: str
    named: int  # drives that name it
    possible: int  # drives that name it or would have, at the pooled strength
    diagnosed: int  # all drives
    drivers: int  # that have a drive that names it
    rate: Interval  # named / possible
    strength: Interval  # pooled; its sign is that of most drives
    spread: float  # sd of the strength between drives
    p_value: float  # of so many names, were all of them false
    adjusted: float  # for the false discovery rate over causes and cars
    real: bool  # adjusted p-value at most `rate`
    status: str


def pooled_causes(
    drives: Sequence[Diagnosed], *, false_names: float = FALSE_NAMES, rate: float = RATE
) -> tuple[PooledCause, ...]:
    """Pool the diagnoses of many drives, by car and cause.

    Args:
        drives: one per diagnosed drive and cause, also of causes that it does not name.
        false_names: chance that a drive without the cause names it.
        rate: false discovery rate.

    Returns:
        Causes that some drive names, those with the smallest p-value first.

    Raises:
        ValueError: `false_names` is no probability between 0 and 1.

    Example:
        >>> who = [(str(k), f"driver {k % 4}", "van") for k in range(12)]
        >>> often = [Diagnosed(*cause, "delay", k < 8, Interval(0.3, 0.2, 0.4), 0.2) for k, cause in enumerate(who)]
        >>> once = [Diagnosed(*cause, "scale", k < 1, detectable=0.1) for k, cause in enumerate(who)]
        >>> [(cause.effect, cause.named, cause.possible, cause.real) for cause in pooled_causes([*often, *once])]
        [('delay', 8, 12, True), ('scale', 1, 12, False)]
    """
    if not 0.0 < false_names < 1.0:
        raise ValueError(f"false_names = {false_names}: give a probability between 0 and 1")
    groups: dict[tuple[str, str], list[Diagnosed]] = {}
    for drive in drives:
        groups.setdefault((drive.car, drive.effect), []).append(drive)
    pooled = [_pool(group, false_names) for group in groups.values() if any(drive.named for drive in group)]
    fdr = adjusted(np.array([cause.p_value for cause in pooled]))
    out = [
        cause._replace(adjusted=float(q), real=bool(q <= rate)) for cause, q in zip(pooled, fdr, strict=True)
    ]
    return tuple(sorted(out, key=lambda cause: (cause.p_value, -cause.named, cause.car, cause.effect)))


def random_effects_mean(values: Sequence[Interval]) -> tuple[Interval, float]:
    """Mean of estimates with their errors and the spread between them (Paule & Mandel 1982; Knapp & Hartung 2003).

    Args:
        values: of one quantity; those without an interval are left out, unless none has one.

    Returns:
        The mean with its 95 % interval, and the standard deviation between; NaN: not known.

    Example:
        >>> mean, spread = random_effects_mean([Interval(x, x - 0.2, x + 0.2) for x in (1.0, 2.0, 3.0)])
        >>> round(mean.value, 1), round(spread, 1), mean.low < 1.0 < 3.0 < mean.high
        (2.0, 1.0, True)
    """
    y, v = np.array([x.value for x in values]), np.array([_variance(x) for x in values])
    if not np.isfinite(y).any():
        return Interval(), NAN
    if not np.isfinite(v).any():
        return Interval(float(np.nanmean(y))), NAN
    known = np.isfinite(y) & np.isfinite(v)
    y, v = y[known], np.maximum(v[known], 1e-300)
    if len(y) == 1:
        half = NORMAL_QUANTILE * math.sqrt(float(v[0]))
        return Interval(float(y[0]), float(y[0]) - half, float(y[0]) + half), NAN
    low, high = 0.0, float(np.ptp(y)) ** 2
    if _squares(y, v, 0.0) > len(y) - 1:
        while _squares(y, v, high) > len(y) - 1:
            high *= 2.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if _squares(y, v, middle) > len(y) - 1 else (low, middle)
    weight = 1.0 / (v + low)
    mean = float(weight @ y / weight.sum())
    # Knapp & Hartung's variance; not below the one of known weights (their refinement is else too short by chance)
    scale = max(1.0, _squares(y, v, low) / (len(y) - 1))
    half = float(stdtrit(len(y) - 1, QUANTILES[1])) * math.sqrt(scale / float(weight.sum()))
    return Interval(mean, mean - half, mean + half), math.sqrt(low)


def _squares(y: Array, v: Array, spread: float) -> float:
    weight = 1.0 / (v + spread)
    return float(weight @ (y - float(weight @ y / weight.sum())) ** 2)


def _variance(x: Interval) -> float:
    return ((x.high - x.low) / (2.0 * NORMAL_QUANTILE)) ** 2


def _pool(drives: list[Diagnosed], false_names: float) -> PooledCause:
    named = [drive for drive in drives if drive.named]
    strength, spread = random_effects_mean([drive.strength for drive in named])
    typical = abs(strength.value)
    # without a strength every drive that could name the cause at all counts
    possible = [
        drive
        for drive in drives
        if drive.named
        or (math.isfinite(drive.detectable) and (math.isnan(typical) or abs(drive.detectable) <= typical))
    ]
    share, status = _rate(possible)
    return PooledCause(
        drives[0].car,
        drives[0].effect,
        len(named),
        len(possible),
        len(drives),
        len({drive.driver for drive in named}),
        share,
        strength,
        spread,
        float(bdtrc(len(named) - 1, len(drives), false_names)),
        NAN,
        False,
        status,
    )


def _rate(drives: list[Diagnosed]) -> tuple[Interval, str]:
    """Share of drives that name the cause; drives of one driver are a cluster."""
    n, count = len(drives), sum(drive.named for drive in drives)
    share = count / n
    by_driver: dict[str, list[bool]] = {}
    for drive in drives:
        by_driver.setdefault(drive.driver, []).append(drive.named)
    clusters = len(by_driver)
    effect, status = 1.0, ""
    if clusters < MIN_DRIVERS:
        # the most that clusters can do: drives of one driver say all the same
        effect = n / clusters
        status = f"{clusters} driver{'s' * (clusters != 1)}: how drives of other drivers are is hardly known"
    elif 0.0 < share < 1.0:
        # variance of the ratio estimate over clusters (Rao & Scott 1992, eq. 2) against the binomial one
        residual = np.array([sum(x) - len(x) * share for x in by_driver.values()])
        variance = clusters / (clusters - 1.0) * float(np.sum(residual**2)) / n**2
        effect = max(1.0, variance * n / (share * (1.0 - share)))
    independent = n / effect
    a, b = count / effect + 0.5, (n - count) / effect + 0.5
    low, high = (float(betaincinv(a, b, q)) for q in QUANTILES)
    # Jeffreys' interval ends at 0 and 1 where no, or every, drive names it
    low, high = (0.0 if count == 0 else low), (1.0 if count == n else high)
    if independent < 2.0 and not status:
        status = "drives of one driver are alike: few independent drives"
    return Interval(share, low, high), status
