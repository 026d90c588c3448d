"""Hierarchical multivariate normal model of drives and drivers: partial pooling of estimates with known covariances.

An estimate is y_ij ~ N(mu_i, S_ij + W) of drive j of driver i, and mu_i ~ N(mu, B): S is the sampling error that the
identification states, W the spread between drives of one driver, B that between drivers (Raudenbush & Bryk 2002, chapter 7,
known variances; Gelman & Hill 2006, chapters 12 and 13). A Gibbs sampler (`gibbs`) with half-t priors of the standard
deviations (Huang & Wand 2013), from a fixed seed: the same table gives the same numbers.

Why not REML: with 2 to 10 drivers its B is 0 in a large share of fleets in which drivers differ, shrunken estimates then
collapse onto the mean, and plug-in intervals do not know that B and W are estimated (Gelman 2006; Chung et al. 2013); here
each number has the posterior's interval. Why not a library: statsmodels' MixedLM takes no known covariance of errors, PyMARE
and metafor's peers in Python one parameter at a time, and general samplers (PyMC, NumPyro) bring a compiler for 300 lines.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from canid.mathematics.population import estimates, gibbs, scaling, spread
from canid.mathematics.population.drive_table import DriveTable, Flags, Index, check, known
from canid.mathematics.population.estimates import Estimates
from canid.mathematics.population.spread import Spread
from canid.values.types import NAN, Array

# chains, and steps of each: the ends of intervals are then known to some 0.1 sd
CHAINS, STEPS = 6, 800
# of large tables, whose posterior is nearly normal and narrow against the spread
FEW_CHAINS, FEW_STEPS = 2, 500
# numbers in the covariances of the estimates from which on a table is large: a step of all chains then takes 4 ms
LARGE = 12_000
# share of the steps that is dropped: chains forget their start within some ten steps, of large tables within fifty
DROPPED = 0.4
# potential scale reduction above which a longer run is made, once (Gelman & Rubin 1992: "below 1.1 for most examples")
MAX_REDUCTION, LONGER = 1.1, 4
# draws of which a driver's predictive distribution is the mixture: it is smooth, and its quantiles are then known to 0.05 sd
MIXTURE_DRAWS = 200
# probability of being an outlier from which on a drive or driver is called one
OUTLIER = 0.5
# W of drives that are not repeated, in units of the prior's scale: next to any error it is nothing
NO_SPREAD = 1e-8
# drivers below which the spread between them is hardly known: of two there is one difference
MIN_DRIVERS = 3


class Draws(NamedTuple):
    """Draws of the posterior, for p-values and intervals of other quantities. NaN: a parameter that no drive knows."""

    mean: Array  # (D, p)
    between: Array  # (D, p, p)
    within: Array  # (D, p, p)


class Population(NamedTuple):
    """What many drives say of p parameters. NaN: not known; `status` says why."""

    names: tuple[str, ...]
    drivers: tuple[str, ...]
    drives: tuple[str, ...]
    counts: Array  # (p, 2) drives, and drivers, from which a parameter is known
    mean: Estimates  # (p,) of the population of drivers
    between: Spread  # B, between drivers
    within: Spread  # W, between drives of one driver
    driver: Estimates  # (I, p) shrunken; of a driver without a drive what is predicted
    shrinkage: Array  # (I, p) 0: the driver's own drives alone, 1: the population's mean alone
    drive_weight: Array  # (n,) 1: an ordinary drive; NaN: it knows nothing
    drive_outlier: Array  # (n,) probability of being an outlier
    driver_weight: Array  # (I,)
    driver_outlier: Array  # (I,)
    new_driver: Estimates  # (p,) predictive: true parameters of an ordinary drive of a new driver
    new_drive: Estimates  # (I, p) predictive: of another drive of each driver
    status: tuple[str, ...]  # (p,) what of a parameter is not identifiable, and what to do; "": all is
    says: tuple[str, ...]  # of the whole table: outliers by name, and whether the sampler converged
    reduction: float  # potential scale reduction of the chains, the largest one; 1: converged
    draws: Draws


def pool(table: DriveTable, *, seed: int = 0) -> Population:
    """Pool the drives of a table.

    Args:
        table: n drives of p parameters.
        seed: of the sampler.

    Returns:
        NaN where nothing is known; weak data are statuses.

    Raises:
        ValueError: the table's columns do not fit each other.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> rng = np.random.default_rng(2)
        >>> gain = np.repeat(rng.normal(5.0, 1.0, 12), 4) + rng.normal(0.0, 0.3, 48) + rng.normal(0.0, 0.2, 48)
        >>> drivers = tuple(f"driver {k // 4}" for k in range(48))
        >>> pooled = pool(drive_table(("K",), gain[:, None], np.full((48, 1), 0.2**2), drivers))
        >>> bool(pooled.mean.low[0] < 5.0 < pooled.mean.high[0]), bool(pooled.between.low[0] < 1.0 < pooled.between.high[0])
        (True, True)
        >>> pooled.status
        ('',)
    """
    check(table)
    has = known(table)
    column = np.flatnonzero(has.any(axis=0)).astype(np.intp)
    row = np.flatnonzero(has.any(axis=1)).astype(np.intp)
    if not len(row):
        return _nothing(table)
    order = row[np.argsort(table.driver[row], kind="stable")]
    units = scaling.units(table, has)
    data, present = scaling.data(table, has, order, column, units)
    # no driver has two drives: the two spreads are one, which the drivers' deviations take
    one_each = len(data.driver) == len(present)
    sampled, reduction = run(data, seed, within=NO_SPREAD * np.eye(len(column)) if one_each else None)

    # draws of all chains in a row, in the table's units
    k, p, n, drivers = len(column), len(table.names), len(table.driver), len(table.drivers)
    unit = units.size[column]
    outer = unit[:, None] * unit[None, :]
    mean = (sampled.mean[:, :, 0] * unit + units.centre[column]).reshape(-1, k)
    between, within = ((x * outer).reshape(-1, k, k) for x in (sampled.between, sampled.within))
    by_driver = (np.moveaxis(sampled.deviation, 1, -1) * unit).reshape(len(mean), -1, k) + mean[:, None, :]

    counts = np.array(
        [(knows.sum(), len(set(table.driver[knows].tolist()))) for knows in has.T], dtype=np.float64
    )
    # one driver has no spread between drivers; of one drive of each driver the two spreads are one, whatever the drives say
    # of other parameters: what would be stated of each is its prior
    alone, once = counts[column, 1] < 2.0, counts[column, 0] == counts[column, 1]
    new_driver = estimates.withheld(estimates.of_mixture(mean, between + within), alone)
    another_driver = estimates.withheld(estimates.of_mixture(mean, between), alone)
    another_drive = _another_drive(by_driver, within, once)
    place = np.full(drivers, -1, dtype=np.intp)
    place[present] = np.arange(len(present))
    drive_outlier = _filled(sampled.drive_outlier.mean(axis=0), order, n, NAN)
    driver_outlier = _filled(sampled.driver_outlier.mean(axis=0), present, drivers, 0.0)
    pull = np.clip(sampled.pull.mean(axis=1).T, 0.0, 1.0)
    return Population(
        names=table.names,
        drivers=table.drivers,
        drives=table.drives,
        counts=counts,
        mean=_wide(estimates.of_draws(mean), column, p),
        between=spread.of_draws(between, alone | once, column, p),
        within=spread.of_draws(within, once, column, p),
        driver=estimates.placed(estimates.of_draws(by_driver), place, another_driver, column, p),
        shrinkage=spread.wide(_filled(pull, present, drivers, 1.0), column, p, 1),
        drive_weight=_filled(sampled.drive_weight.mean(axis=0), order, n, NAN),
        drive_outlier=drive_outlier,
        driver_weight=_filled(sampled.driver_weight.mean(axis=0), present, drivers, 1.0),
        driver_outlier=driver_outlier,
        new_driver=_wide(new_driver, column, p),
        new_drive=estimates.placed(another_drive, place, new_driver, column, p),
        status=tuple(
            _status(table, knows, int(count)) for knows, count in zip(has.T, counts[:, 1], strict=True)
        ),
        # of one drive each only the driver is odd, or not
        says=_says(table, np.where(one_each, 0.0, drive_outlier), driver_outlier, reduction),
        reduction=reduction,
        draws=Draws(
            spread.wide(mean, column, p, 1),
            spread.wide(between, column, p, 2),
            spread.wide(within, column, p, 2),
        ),
    )


def run(
    data: gibbs.Data,
    seed: int,
    *,
    between: Array | None = None,
    within: Array | None = None,
    most_steps: int = STEPS,
) -> tuple[gibbs.Draws, float]:
    """Run the sampler until its chains agree.

    Args:
        data: of one chain.
        seed: of the random numbers.
        between: (p, p) B, where it is not to be estimated.
        within: (p, p) W, likewise.
        most_steps: of each chain, where they agree after so many.

    Returns:
        Draws, and the potential scale reduction.

    Example:
        >>> ones = np.ones((1, 1, 6))
        >>> data = gibbs.Data(np.arange(6.0)[None, None], ones[None], ones > 0.0, np.arange(6), np.zeros(6, dtype=int))
        >>> run(data, 0)[1] < 1.1
        True
    """
    large = data.s.size > LARGE
    chains, steps = (FEW_CHAINS, FEW_STEPS) if large else (CHAINS, STEPS)
    steps = min(steps, most_steps)
    many = data._replace(
        y=np.repeat(data.y, chains, axis=1),
        s=np.repeat(data.s, chains, axis=2),
        known=np.repeat(data.known, chains, axis=1),
    )
    sample = partial(gibbs.sample, many, fixed=between, fixed_within=within)
    sampled = sample(np.random.default_rng(seed), *_lengths(steps))
    reduction = _reduction(sampled, between is None, within is None)
    if reduction > MAX_REDUCTION and not large:
        sampled = sample(np.random.default_rng(seed), *_lengths(LONGER * steps))
        reduction = _reduction(sampled, between is None, within is None)
    return sampled, reduction


def _lengths(steps: int) -> tuple[int, int]:
    burn = round(DROPPED * steps)
    return burn, steps - burn


def _reduction(draws: gibbs.Draws, between: bool, within: bool) -> float:
    """Potential scale reduction of means and of logarithms of standard deviations, the largest (Gelman & Rubin 1992).

    Of B and W where they were estimated: the round-off of a constant, over a variance of 0, would be any number.
    """
    count = len(draws.mean)
    variances = [np.einsum("dckk->dck", x) for x in ((draws.between,) * between + (draws.within,) * within)]
    x = np.concatenate(
        [draws.mean.reshape(*draws.mean.shape[:2], -1), *(np.log(v) for v in variances)], axis=2
    )
    inside = np.maximum(x.var(axis=0, ddof=1).mean(axis=0), 1e-300)
    return float(np.sqrt(np.max((count - 1.0) / count + x.mean(axis=0).var(axis=0, ddof=1) / inside)))


def _another_drive(by_driver: Array, within: Array, unknown: Flags) -> Estimates:
    """Predictive of another drive, driver by driver: an array of all draws of all drivers' covariances would be large."""
    if unknown.all():
        unknowns = np.full(by_driver.shape[1:], NAN)
        covariances = np.full((*by_driver.shape[1:], by_driver.shape[2]), NAN)
        return Estimates(unknowns, unknowns, unknowns, covariances)
    thin = np.linspace(0, len(by_driver) - 1, min(MIXTURE_DRAWS, len(by_driver))).astype(np.intp)
    each = [estimates.of_mixture(by_driver[thin, i], within[thin]) for i in range(by_driver.shape[1])]
    columns = [np.array([estimate[k] for estimate in each]) for k in range(4)]
    # the mixture's correlations are those of W; the driver's own uncertainty has others
    drawn = np.einsum("ikk->ik", estimates.of_draws(by_driver).covariance)
    share = np.clip(drawn / np.maximum(np.einsum("ikk->ik", columns[3]), 1e-300), 0.0, 1.0)
    sd = np.sqrt(np.einsum("ikk->ik", columns[3]))
    a, b = np.sqrt(share), np.sqrt(1.0 - share)
    correlation = estimates.correlation_of(by_driver) * a[:, :, None] * a[:, None, :]
    correlation += spread.correlations(within).mean(axis=0) * b[:, :, None] * b[:, None, :]
    predictive = Estimates(columns[0], columns[1], columns[2], correlation * sd[:, :, None] * sd[:, None, :])
    return estimates.withheld(predictive, unknown)


def _filled(x: Array, places: Index, count: int, value: float) -> Array:
    out = np.full((count, *x.shape[1:]), value)
    out[places] = x
    return out


def _wide(part: Estimates, column: Index, p: int) -> Estimates:
    value, low, high = (spread.wide(x, column, p, 1) for x in part[:3])
    return Estimates(value, low, high, spread.wide(part.covariance, column, p, 2))


def _status(table: DriveTable, has: Flags, drivers: int) -> str:
    """What of one parameter is not identifiable."""
    drives = int(has.sum())
    if not drives:
        return "no drive knows it"
    out = []
    if drivers == 1:
        out.append(
            "one driver: the spread between drivers is not known, and nothing is predicted of a new driver"
        )
    elif drivers < MIN_DRIVERS:
        out.append("two drivers: the spread between drivers is hardly known; add drives of other drivers")
    if drives == 1:
        out.append("one drive: the spread between drives of one driver is not known")
    elif drives == drivers:
        out.append(
            "one drive per driver: the spread between drives of one driver cannot be separated from that between "
            "drivers; add a second drive of some drivers"
        )
    return "; ".join(out)


def _says(table: DriveTable, drive: Array, driver: Array, reduction: float) -> tuple[str, ...]:
    out = []
    drives = [table.drives[k] for k in np.argsort(-np.nan_to_num(drive)) if drive[k] > OUTLIER]
    if drives:
        out.append(f"{len(drives)} of {len(drive)} drives are outliers and weigh less: {_list(drives)}")
    drivers = [table.drivers[k] for k in np.argsort(-driver) if driver[k] > OUTLIER]
    if drivers:
        out.append(f"{len(drivers)} of {len(driver)} drivers are outliers and weigh less: {_list(drivers)}")
    if reduction > MAX_REDUCTION:
        out.append(
            f"the sampler did not converge (potential scale reduction {reduction:.2f}): intervals may be wrong; leave "
            "out parameters that few drives know"
        )
    return tuple(out)


def _list(names: list[str]) -> str:
    """The first ten."""
    return ", ".join(names[:10]) + (f" and {len(names) - 10} more" if len(names) > 10 else "")


def _nothing(table: DriveTable) -> Population:
    p, n, drivers = len(table.names), len(table.driver), len(table.drivers)
    none, square = np.full(p, NAN), np.full((p, p), NAN)
    spread_ = Spread(none, none, none, square, square, square, square)
    unknown = Estimates(none, none, none, square)
    all_ = np.full((drivers, p), NAN)
    each = Estimates(all_, all_, all_, np.full((drivers, p, p), NAN))
    return Population(
        names=table.names,
        drivers=table.drivers,
        drives=table.drives,
        counts=np.zeros((p, 2)),
        mean=unknown,
        between=spread_,
        within=spread_,
        driver=each,
        shrinkage=np.full((drivers, p), NAN),
        drive_weight=np.full(n, NAN),
        drive_outlier=np.full(n, NAN),
        driver_weight=np.ones(drivers),
        driver_outlier=np.zeros(drivers),
        new_driver=unknown,
        new_drive=each,
        status=("no drive knows it",) * p,
        says=("no drive has an estimate",),
        reduction=NAN,
        draws=Draws(np.empty((0, p)), np.empty((0, p, p)), np.empty((0, p, p))),
    )
