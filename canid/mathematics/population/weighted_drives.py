"""Drives as the tests of this package take them: scaled, with their weights, and their information given a draw of W."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from canid.mathematics.population import gibbs, scaling
from canid.mathematics.population.batched_inverse import inverse
from canid.mathematics.population.drive_table import DriveTable, Flags, Index, known
from canid.mathematics.population.hierarchical import Population, run
from canid.values.types import Array

# draws over which p-values are averaged: they are then known to 5 % where W is hardly known, and better elsewhere
DRAWS = 200
# numbers that an operation on all draws may touch: about ten seconds
WORK = 400_000_000
# variance of fixed effects, in squares of the estimates' whole spread
WIDE = 1e4
# steps of each of six chains, of which 144 count: the drives of each driver alone decide W, whose chains forget their start
# within ten steps, and `DRAWS` of them are used
FIXED_EFFECTS_STEPS = 240
# fewest draws, of large tables, where W is known to some percent
FEWEST_DRAWS = 20


class WeightedDrives(NamedTuple):
    """Of n' drives that know something of k parameters that some drive knows; in the units of `scaling`."""

    y: Array  # (k, n') 0 where not known
    s: Array  # (k, k, n') 0 where not known
    known: Flags  # (k, n')
    driver: Index  # (n',) places among `present`, ascending
    first: Index  # (I',) where each driver's drives begin
    weight: Array  # (n',)
    order: Index  # (n',) places in the table
    present: Index  # (I',) places in the table's drivers
    column: Index  # (k,) places in the table's names
    centre: Array  # (k,)
    unit: Array  # (k,)


class Draw(NamedTuple):
    """Of the posterior, in the units of `scaling`."""

    mean: Array  # (k,)
    between: Array  # (k, k)
    within: Array  # (k, k)


def prepare(table: DriveTable, population: Population) -> WeightedDrives | None:
    """Scale and order the drives.

    Args:
        table: n drives.
        population: of the same table.

    Returns:
        None where no drive knows anything.

    Raises:
        ValueError: the population is that of another table.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> table = drive_table(("K",), np.arange(4.0)[:, None], np.ones((4, 1)), ("b", "a", "b", "a"))
        >>> weighted = prepare(table, pool(table))
        >>> weighted.order.tolist(), weighted.first.tolist()
        ([0, 2, 1, 3], [0, 2])
    """
    if population.drives != table.drives or population.names != table.names:
        raise ValueError("the population is that of another table: give the table that was pooled")
    has = known(table)
    column = np.flatnonzero(has.any(axis=0)).astype(np.intp)
    row = np.flatnonzero(has.any(axis=1)).astype(np.intp)
    if not len(row):
        return None
    order = row[np.argsort(table.driver[row], kind="stable")]
    units = scaling.units(table, has)
    data, present = scaling.data(table, has, order, column, units)
    first = np.flatnonzero(np.diff(data.driver, prepend=-1)).astype(np.intp)
    return WeightedDrives(
        data.y[:, 0],
        data.s[:, :, 0],
        data.known[:, 0],
        data.driver,
        first,
        population.drive_weight[order],
        order,
        present,
        column,
        units.centre[column],
        units.size[column],
    )


def scaled(weighted: WeightedDrives, covariance: Array) -> Array:
    """Covariance of all parameters, (..., p, p), of those that these drives know and in their units, (..., k, k)."""
    part: Array = covariance[..., weighted.column[:, None], weighted.column]
    return part / (weighted.unit[:, None] * weighted.unit[None, :])


def number(weighted: WeightedDrives, work: int = 0) -> int:
    """Draws that the size of a task allows; arguments as of `draws`."""
    return max(FEWEST_DRAWS, min(DRAWS, WORK // max(work or weighted.s.size, 1)))


def draws(weighted: WeightedDrives, population: Population, work: int = 0) -> Iterator[Draw]:
    """Draws of the posterior, evenly over all, as many as the size of the task allows.

    Args:
        weighted: the drives.
        population: of the same table.
        work: numbers that the caller touches for each draw; 0: as many as there are in the covariances.

    Yields:
        One after another.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> table = drive_table(("K",), np.arange(4.0)[:, None], np.ones((4, 1)), ("b", "a", "b", "a"))
        >>> population = pool(table)
        >>> len(list(draws(prepare(table, population), population)))
        200
    """
    count = len(population.draws.mean)
    wanted = number(weighted, work)
    for place in np.linspace(0, count - 1, min(wanted, count)).astype(np.intp):
        yield Draw(
            (population.draws.mean[place][weighted.column] - weighted.centre) / weighted.unit,
            scaled(weighted, population.draws.between[place]),
            scaled(weighted, population.draws.within[place]),
        )


def fixed_effects(weighted: WeightedDrives, wanted: int) -> tuple[WeightedDrives, Array]:
    """W from the drives of each driver alone, drivers as fixed effects: what a test of their differences has for its error.

    Where drivers are all one person, B is a little above 0 in the posterior and W as much too small.

    Args:
        weighted: the drives.
        wanted: draws.

    Returns:
        The drives with the weights of that model, and draws of W, (D, k, k).

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> table = drive_table(("K",), np.arange(4.0)[:, None], np.ones((4, 1)), ("b", "a", "b", "a"))
        >>> fixed_effects(prepare(table, pool(table)), 50)[1].shape
        (50, 1, 1)
    """
    group = np.zeros(len(weighted.order), dtype=np.intp)
    data = gibbs.Data(
        weighted.y[:, None], weighted.s[:, :, None], weighted.known[:, None], weighted.driver, group
    )
    sampled, _ = run(data, 0, between=WIDE * np.eye(len(weighted.y)), most_steps=FIXED_EFFECTS_STEPS)
    within = sampled.within.reshape(-1, len(weighted.y), len(weighted.y))
    thin = np.linspace(0, len(within) - 1, min(wanted, len(within))).astype(np.intp)
    return weighted._replace(weight=sampled.drive_weight.mean(axis=0)), within[thin]


def information(weighted: WeightedDrives, within: Array) -> Array:
    """Information of each drive on its driver's parameters: weight times (S + W)^-1, 0 where not known.

    Args:
        weighted: the drives.
        within: (k, k).

    Returns:
        (k, k, n').

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> table = drive_table(("K",), np.arange(4.0)[:, None], np.ones((4, 1)), ("b", "a", "b", "a"))
        >>> information(prepare(table, pool(table)), np.eye(1)).shape
        (1, 1, 4)
    """
    return masked_inverse(weighted.s + within[:, :, None], weighted.known) * weighted.weight


def masked_inverse(a: Array, known: Flags) -> Array:
    """Inverses of the known blocks of matrices, 0 elsewhere.

    Args:
        a: (k, k, m).
        known: (k, m).

    Example:
        >>> masked_inverse(np.array([[[4.0]]]), np.array([[False]])).tolist()
        [[[0.0]]]
    """
    both = known[:, None] & known[None, :]
    eye = np.eye(len(a))[:, :, None]
    return np.asarray(np.where(both, inverse(np.where(both, a, eye)), 0.0))
