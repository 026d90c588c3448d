"""Predictive checks of the labels: does a drive fit its driver, and do two drivers differ.

A drive is left out and compared with what the driver's others and the population predict (leave-one-out predictive p-value,
Gelfand, Dey & Chang 1992, B and W from all drives); two drivers by the generalised distance of their means (Rao 1973,
section 8d) under S + W: sampling error alone would call any two drives of one person different. Given a draw of B and W the
distance is chi-squared; p-values are averages over draws.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri

from canid.mathematics.identification.confidence import MISS, NORMAL_QUANTILE
from canid.mathematics.population import weighted_drives
from canid.mathematics.population.batched_inverse import inverse, times
from canid.mathematics.population.drive_table import DriveTable, Flags, Index
from canid.mathematics.population.false_discovery import RATE, adjusted
from canid.mathematics.population.hierarchical import Population
from canid.mathematics.population.spread import wide
from canid.values.types import NAN, Array

# drivers of whom all pairs are compared: 125,000 pairs take some ten seconds
MAX_DRIVERS = 500
# chance of telling two drivers of this population apart from which on a pair that does not differ is perhaps one person, and
# power by which a detectable difference is stated (Cohen 1988: 0.8)
POWER = 0.8
# normal quantiles of a two-sided test, and of that power
DETECTABLE = NORMAL_QUANTILE + 0.84
ONE_DRIVE_EACH = (
    "one drive per driver: differences between drivers and between drives of one driver cannot be separated; record a "
    "second drive of some drivers"
)


class DriveFit(NamedTuple):
    """Of n drives. NaN: not tested; `status` says why."""

    p_value: Array  # (n,) of all parameters together
    adjusted: Array  # (n,) for the false discovery rate
    score: Array  # (n, p) standard normal score of each parameter
    misfit: Flags  # (n,) adjusted p-value at most `rate`
    closest: Index  # (n,) of misfits: the driver whom the drive fits best; else its own
    status: tuple[str, ...]


class Pairs(NamedTuple):
    """Of m pairs of drivers. NaN: not tested."""

    a: Index  # (m,) places in the table's drivers
    b: Index
    difference: Array  # (m, p) b - a
    sd: Array  # (m, p) of it: sampling error and spread between drives
    p_value: Array  # (m,) of all parameters that both have
    adjusted: Array  # (m,) for the false discovery rate of dependent tests: pairs share drivers
    power: Array  # (m,) chance that two drivers of this population would have p < 5 %
    detectable: Array  # (m, p) difference that would have p < 5 % with a probability of 0.8
    different: Flags  # (m,)
    status: tuple[str, ...]  # (m,)
    says: tuple[str, ...]


def drives_fit(table: DriveTable, population: Population, *, rate: float = RATE) -> DriveFit:
    """Does each drive fit the driver that it is labelled with.

    Args:
        table: n drives.
        population: of it.
        rate: false discovery rate.

    Raises:
        ValueError: the population is that of another table.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> rng = np.random.default_rng(2)
        >>> gain = np.repeat([3.0, 4.0, 5.0, 6.0, 7.0], 5) + 0.2 * rng.standard_normal(25)
        >>> gain[7] = 6.0
        >>> table = drive_table(("K",), gain[:, None], np.full((25, 1), 0.01), tuple(np.repeat(list("abcde"), 5)))
        >>> fit = drives_fit(table, pool(table))
        >>> np.flatnonzero(fit.misfit).tolist(), table.drivers[int(fit.closest[7])]
        ([7], 'd')
    """
    n, p = table.estimate.shape
    p_value, score = np.full(n, NAN), np.full((n, p), NAN)
    status = ["no estimate"] * n
    closest = table.driver.copy()
    weighted = weighted_drives.prepare(table, population)
    if weighted is None:
        return DriveFit(p_value, p_value.copy(), score, np.zeros(n, dtype=bool), closest, tuple(status))
    count = weighted.known.sum(axis=0).astype(np.float64)
    total, scores, used = np.zeros(len(weighted.order)), np.zeros(weighted.y.shape), 0
    for draw in weighted_drives.draws(weighted, population):
        ahead = weighted_drives.information(weighted, draw.within)
        pulled = times(ahead, weighted.y)
        b_inverse = np.linalg.inv(draw.between)
        q = np.add.reduceat(ahead, weighted.first, axis=-1)[..., weighted.driver] - ahead
        h = np.add.reduceat(pulled, weighted.first, axis=-1)[..., weighted.driver] - pulled
        t = inverse(q + b_inverse[..., None])
        residual = np.where(weighted.known, weighted.y - times(t, h + (b_inverse @ draw.mean)[:, None]), 0.0)
        variance = weighted.s + draw.within[..., None] + t
        distance = np.sum(
            residual * times(weighted_drives.masked_inverse(variance, weighted.known), residual), axis=0
        )
        total += chdtrc(count, np.maximum(distance, 0.0))
        scores += residual / np.sqrt(np.einsum("kkn->kn", variance))
        used += 1
    drives_of = np.bincount(weighted.driver)[weighted.driver]
    tested = drives_of > 1
    p_value[weighted.order] = np.where(tested, total / used, NAN)
    scores = np.where(weighted.known & tested, scores / used, NAN)
    score[weighted.order] = wide(scores.T, weighted.column, p, 1)
    for k, place in enumerate(weighted.order):
        status[place] = "" if tested[k] else "the driver's only drive: nothing to compare it with"
    fdr = adjusted(p_value)
    misfit = np.nan_to_num(fdr, nan=1.0) <= rate
    inner = np.flatnonzero(misfit[weighted.order])
    closest[weighted.order[inner]] = weighted.present[_closest(weighted, population, inner.astype(np.intp))]
    return DriveFit(p_value, fdr, score, misfit, closest, tuple(status))


def _closest(weighted: weighted_drives.WeightedDrives, population: Population, drives: Index) -> Index:
    """The driver by whose predictive density a drive is most likely; the drive's own without it would need a fit more."""
    centre = (
        (population.driver.value[weighted.present][:, weighted.column] - weighted.centre) / weighted.unit
    ).T
    covariance = weighted_drives.scaled(weighted, population.new_drive.covariance[weighted.present])
    drive_covariance = np.nan_to_num(np.moveaxis(covariance, 0, -1))
    # what no driver has two drives of is not predicted
    predicted = np.einsum("kki->ki", drive_covariance) > 0.0
    out = np.zeros(len(drives), dtype=np.intp)
    for k, drive in enumerate(drives):
        has = weighted.known[:, drive, None] & predicted
        ahead = weighted_drives.masked_inverse(weighted.s[:, :, drive, None] + drive_covariance, has)
        residual = np.where(has, weighted.y[:, drive, None] - centre, 0.0)
        block = np.moveaxis(ahead + np.eye(len(ahead))[..., None] * ~has, -1, 0)
        density = np.linalg.slogdet(block)[1] - np.sum(residual * times(ahead, residual), axis=0)
        out[k] = int(np.argmax(density))
    return out


def pairs(table: DriveTable, population: Population, *, rate: float = RATE) -> Pairs:
    """Do drivers differ, each pair of them.

    Args:
        table: n drives.
        population: of it.
        rate: false discovery rate.

    Returns:
        Pairs of the 500 drivers with the most drives.

    Raises:
        ValueError: the population is that of another table.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> rng = np.random.default_rng(1)
        >>> gain = np.repeat([3.0, 4.0, 5.0, 6.0, 6.0], 5) + 0.2 * rng.standard_normal(25)
        >>> table = drive_table(("K",), gain[:, None], np.full((25, 1), 0.01), tuple(np.repeat(list("abcde"), 5)))
        >>> compared = pairs(table, pool(table))
        >>> [table.drivers[compared.a[k]] + table.drivers[compared.b[k]] for k in np.flatnonzero(~compared.different)]
        ['de']
        >>> compared.status[-1]
        'perhaps one person: drivers of this population would mostly be seen to differ'
    """
    p = len(table.names)
    weighted = weighted_drives.prepare(table, population)
    drives_of = np.zeros(0) if weighted is None else np.bincount(weighted.driver)
    chosen = np.sort(np.argsort(-drives_of, kind="stable")[:MAX_DRIVERS])
    left, right = np.triu_indices(len(chosen), 1)
    # without two drives of one driver nothing says how much the drives of one driver differ
    repeated = drives_of.max(initial=0.0) > 1.0
    if weighted is None or not len(left) or not repeated:
        none, wide_ = np.zeros(0), np.zeros((0, p))
        index = np.zeros(0, dtype=np.intp)
        says = (
            "fewer than two drivers: nothing to compare"
            if not len(left)
            else "one drive per driver: differences between drivers cannot be separated from those between drives; add a "
            "second drive of some drivers",
        )
        return Pairs(index, index, wide_, wide_, none, none, none, wide_, none > 0.0, (), says)
    a, b = chosen[left].astype(np.intp), chosen[right].astype(np.intp)
    has = np.asarray(np.logical_or.reduceat(weighted.known, weighted.first, axis=-1))
    both = has[:, a] & has[:, b]
    count = both.sum(axis=0).astype(np.float64)
    total, used = np.zeros(len(a)), 0
    mean, square = np.zeros((len(weighted.y), len(a))), np.zeros((len(weighted.y), len(a)))
    spent = len(weighted.y) ** 2 * (len(a) + len(weighted.order))
    covariance = np.zeros((len(weighted.y), len(weighted.y), len(a)))
    weighted, withins = weighted_drives.fixed_effects(weighted, weighted_drives.number(weighted, spent))
    for within in withins:
        ahead = weighted_drives.information(weighted, within)
        driver_covariance = weighted_drives.masked_inverse(
            np.add.reduceat(ahead, weighted.first, axis=-1), has
        )
        value = times(driver_covariance, np.add.reduceat(times(ahead, weighted.y), weighted.first, axis=-1))
        difference = np.where(both, value[:, b] - value[:, a], 0.0)
        error = driver_covariance[:, :, a] + driver_covariance[:, :, b]
        distance = np.sum(difference * times(weighted_drives.masked_inverse(error, both), difference), axis=0)
        total += chdtrc(np.maximum(count, 1.0), np.maximum(distance, 0.0))
        mean += difference
        square += difference**2
        covariance += error
        used += 1
    mean, covariance = mean / used, covariance / used
    variance = np.einsum("kkm->km", covariance) + np.maximum(square / used - mean**2, 0.0)
    # with one drive of each driver a difference may be one of drives
    single = len(weighted.order) == len(weighted.first)
    tested = (count > 0) & (not single)
    p_value = np.where(tested, total / used, NAN)
    fdr = adjusted(p_value, dependent=True)
    different = np.nan_to_num(fdr, nan=1.0) <= rate
    power = np.where(tested, _power(weighted, population, covariance, both), NAN)
    sd = np.where(both, np.sqrt(variance), NAN) * weighted.unit[:, None]
    difference = np.where(both, mean, NAN) * weighted.unit[:, None]
    status = tuple(
        ONE_DRIVE_EACH if single else _status(bool(t), bool(d), float(x), float(w))
        for t, d, x, w in zip(tested, different, p_value, power, strict=True)
    )
    capped: tuple[str, ...] = ()
    if len(chosen) < len(drives_of):
        capped = (
            f"pairs of the {len(chosen)} drivers with the most drives; give a table of fewer for others",
        )
    return Pairs(
        weighted.present[a],
        weighted.present[b],
        wide(difference.T, weighted.column, p, 1),
        wide(sd.T, weighted.column, p, 1),
        p_value,
        fdr,
        power,
        wide(DETECTABLE * sd.T, weighted.column, p, 1),
        different,
        status,
        capped,
    )


def _power(
    weighted: weighted_drives.WeightedDrives, population: Population, error: Array, both: Flags
) -> Array:
    """Chance of p < 5 % for two drivers drawn from the population.

    Their distance is a weighted sum of chi-squared variates; a multiple of one with its mean and variance (Box 1954, theorem
    3.1).
    """
    between = np.nan_to_num(weighted_drives.scaled(weighted, population.between.covariance))
    ahead = weighted_drives.masked_inverse(error, both)
    ratio = 2.0 * np.einsum("klm,lj->kjm", ahead, between) + np.eye(len(between))[..., None] * both
    mean = np.einsum("kkm->m", ratio)
    variance = 2.0 * np.einsum("klm,lkm->m", ratio, ratio)
    count = np.maximum(both.sum(axis=0), 1).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        multiple, freedom = variance / (2.0 * mean), 2.0 * mean**2 / variance
        return np.asarray(chdtrc(freedom, chdtri(count, MISS) / multiple))


def _status(tested: bool, different: bool, p_value: float, power: float) -> str:
    if not tested:
        return "no parameter is known of both"
    if different:
        return "they differ"
    if p_value < MISS:
        return "they perhaps differ: not beyond what chance gives among so many pairs; record more drives"
    if power >= POWER:
        return "perhaps one person: drivers of this population would mostly be seen to differ"
    return "cannot be separated: these drives would not show an ordinary difference; record more drives"
