"""Change of a driver's parameters over weeks: generalised least squares on the date, with the spread between drives.

Given a draw of W the errors are N(0, S + W) and the slope is normal (Aitken 1935); intervals and p-values are those of the
mixture over draws. Errors of sampling alone would call the spread between drives a change. Outliers are weighed down by
their distance from the line: from the mean of a driver who changes the first and last drives are far, and no outliers.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, ndtr

from canid.mathematics.population import gibbs, normal_mixture, weighted_drives
from canid.mathematics.population.batched_inverse import times
from canid.mathematics.population.drive_table import DriveTable, Flags, rows
from canid.mathematics.population.false_discovery import RATE, adjusted
from canid.mathematics.population.hierarchical import Population
from canid.mathematics.population.spread import wide
from canid.values.types import NAN, Array

WEEK_S = 7.0 * 86400.0
# drives of a parameter: of three, a line leaves one degree of freedom, and one odd drive makes any slope
MIN_DRIVES = 4
# weeks between the first and the last one: in less, a slope per week is an extrapolation
MIN_WEEKS = 1.0
# weights, line, weights, line, weights: from the median slope on they then change by less than a tenth
WEIGHT_STEPS = 3


class Change(NamedTuple):
    """Of I drivers. NaN: not tested; `status` says why."""

    slope: Array  # (I, p) per week
    low: Array  # of the 95 % interval
    high: Array
    p_value: (
        Array  # (I,) that no parameter changes: of all together, or of the clearest one, twice the smaller
    )
    adjusted: Array  # (I,) for the false discovery rate
    changed: Flags  # (I,)
    drives: Array  # (I,) with a date
    weeks: Array  # (I,) between the first and the last
    status: tuple[str, ...]  # (I,) "": tested


def change_over_time(table: DriveTable, population: Population, *, rate: float = RATE) -> Change:
    """Do drivers change over weeks.

    Args:
        table: n drives; those without a date are left out.
        population: of the same table.
        rate: false discovery rate.

    Raises:
        ValueError: the population is that of another table.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> rng = np.random.default_rng(3)
        >>> week = np.tile(np.arange(6.0), 5)
        >>> gain = 5.0 + 0.2 * rng.standard_normal(30) + np.repeat([0.0, 0.0, 0.0, 0.0, 0.4], 6) * week
        >>> names = tuple(np.repeat(list("abcde"), 6))
        >>> table = drive_table(("K",), gain[:, None], np.full((30, 1), 0.01), names, start=week * WEEK_S)
        >>> change = change_over_time(table, pool(table))
        >>> change.changed.tolist(), bool(change.low[4, 0] < 0.4 < change.high[4, 0])
        ([False, False, False, False, True], True)
    """
    p, drivers = len(table.names), len(table.drivers)
    dated = np.isfinite(table.start)
    count = np.bincount(table.driver[dated], minlength=drivers)
    weeks = np.full(drivers, NAN)
    for k in np.flatnonzero(count):
        of_driver = table.start[dated & (table.driver == k)]
        weeks[k] = float(np.ptp(of_driver)) / WEEK_S
    slope, low, high = (np.full((drivers, p), NAN) for _ in range(3))
    p_value = np.full(drivers, NAN)
    part = population._replace(
        drives=tuple(table.drives[k] for k in np.flatnonzero(dated)),
        drive_weight=population.drive_weight[dated],
    )
    weighted_drives.prepare(table, population)  # refuses another table's population
    weighted = weighted_drives.prepare(rows(table, dated), part) if dated.any() else None
    if weighted is not None:
        t = (table.start[dated][weighted.order] - np.mean(table.start[dated])) / WEEK_S
        span = np.maximum.reduceat(t, weighted.first) - np.minimum.reduceat(t, weighted.first)
        enough = np.add.reduceat(weighted.known.astype(np.float64), weighted.first, axis=-1) >= MIN_DRIVES
        enough &= span >= MIN_WEEKS
        used = weighted._replace(known=weighted.known & enough[:, weighted.driver])
        used = used._replace(y=np.where(used.known, weighted.y, 0.0))
        # about each driver's own mean date, so that the two blocks are nearly orthogonal
        t = t - (np.add.reduceat(t, weighted.first) / np.bincount(weighted.driver))[weighted.driver]
        used = used._replace(weight=_weights(used, part, t, enough))
        intervals, p_values = _regress(used, part, t, enough)
        tested = enough.any(axis=0)
        p_value[weighted.present] = np.where(tested, p_values, NAN)
        for whole, x in zip((slope, low, high), intervals, strict=True):
            whole[weighted.present] = wide(
                (np.where(enough, x, NAN) * weighted.unit[:, None]).T, weighted.column, p, 1
            )
    fdr = adjusted(p_value)
    status = tuple(
        _status(int(n), float(w), bool(np.isfinite(q))) for n, w, q in zip(count, weeks, p_value, strict=True)
    )
    return Change(
        slope,
        low,
        high,
        p_value,
        fdr,
        np.nan_to_num(fdr, nan=1.0) <= rate,
        count.astype(np.float64),
        weeks,
        status,
    )


def _weights(
    weighted: weighted_drives.WeightedDrives, population: Population, t: Array, enough: Flags
) -> Array:
    """Weights of the drives about each driver's line, iterated from the median slope (Theil 1950; Sen 1968), (n',)."""
    fitted = np.zeros_like(weighted.y)
    ends = [*weighted.first.tolist(), len(t)]
    for start, end in itertools.pairwise(ends):
        for k in range(len(weighted.y)):
            has = np.flatnonzero(weighted.known[k, start:end]) + start
            i, j = np.triu_indices(len(has), 1)
            i, j = has[i], has[j]
            apart = t[i] != t[j]
            if apart.any():
                slope = float(np.median((weighted.y[k, j] - weighted.y[k, i])[apart] / (t[j] - t[i])[apart]))
                fitted[k, has] = slope * t[has] + np.median(weighted.y[k, has] - slope * t[has])
    within = np.nan_to_num(weighted_drives.scaled(weighted, population.within.covariance))
    bare = weighted_drives.masked_inverse(weighted.s + within[:, :, None], weighted.known)
    count = weighted.known.sum(axis=0)
    constant, share = gibbs.t_constant(count), np.array([gibbs.SHARE_OUTLIER[0] / sum(gibbs.SHARE_OUTLIER)])
    weight = np.ones(len(t))
    for step in range(WEIGHT_STEPS):
        residual = np.where(weighted.known, weighted.y - fitted, 0.0)
        distance = np.sum(residual * times(bare, residual), axis=0)
        p = gibbs.outlier_probability(distance[None], count, constant, share)[0]
        weight = 1.0 - p + p * gibbs.outlier_weight(distance, count)
        if step + 1 < WEIGHT_STEPS:
            level, slopes, _, _ = _line(weighted, bare * weight, t, enough)
            fitted = level[:, weighted.driver] + slopes[:, weighted.driver] * t
    return weight


def _line(
    weighted: weighted_drives.WeightedDrives, ahead: Array, t: Array, enough: Flags
) -> tuple[Array, Array, Array, Array]:
    """Level and slope of each driver, (k, I'), covariance of the slope and its inverse, (k, k, I')."""
    pulled = times(ahead, weighted.y)
    q, qt, qtt = (np.add.reduceat(ahead * t**k, weighted.first, axis=-1) for k in range(3))
    h, ht = (np.add.reduceat(pulled * t**k, weighted.first, axis=-1) for k in range(2))
    # normal equations with the level eliminated (Schur complement)
    inverse = weighted_drives.masked_inverse(q, enough)
    gain = np.stack([times(inverse, qt[:, k]) for k in range(len(qt))], axis=1)
    information = qtt - np.stack([times(qt, gain[:, k]) for k in range(len(qt))], axis=1)
    covariance = weighted_drives.masked_inverse(information, enough)
    slope = times(covariance, ht - times(qt, times(inverse, h)))
    return times(inverse, h - times(qt, slope)), slope, covariance, information


def _regress(
    weighted: weighted_drives.WeightedDrives, population: Population, t: Array, enough: Flags
) -> tuple[tuple[Array, Array, Array], Array]:
    """Slopes with intervals, (k, I') each, and p-values, (I',).

    The joint statistic dilutes a change of one parameter among many, Bonferroni's of the clearest one a small change of all:
    twice the smaller p-value holds the level whatever their dependence.
    """
    count = np.maximum(enough.sum(axis=0), 1).astype(np.float64)
    slopes, sds, total = [], [], np.zeros(len(weighted.first))
    each = np.zeros(enough.shape)
    for draw in weighted_drives.draws(weighted, population):
        ahead = weighted_drives.information(weighted, draw.within)
        _, slope, covariance, information = _line(weighted, ahead, t, enough)
        total += chdtrc(count, np.maximum(np.sum(slope * times(information, slope), axis=0), 0.0))
        sd = np.sqrt(np.einsum("kki->ki", covariance))
        slopes.append(slope)
        sds.append(sd)
        each += 2.0 * ndtr(-np.abs(slope) / np.where(enough, np.maximum(sd, 1e-300), 1.0))
    clearest = count * np.where(enough, each, np.inf).min(axis=0)
    p_value = np.minimum(2.0 * np.minimum(total, clearest) / len(slopes), 1.0)
    return normal_mixture.interval(np.array(slopes), np.array(sds)), p_value


def _status(drives: int, weeks: float, tested: bool) -> str:
    if tested:
        return ""
    if drives < MIN_DRIVES:
        return f"a driver's change needs {MIN_DRIVES} or more drives whose dates are known, here {drives}"
    if not weeks >= MIN_WEEKS:
        span = "one day" if 7.0 * weeks < 1.0 else f"{7.0 * weeks:.0f} days"
        return f"all drives are of {span}, and a change needs a week or more"
    return f"no parameter is known from {MIN_DRIVES} or more drives"
