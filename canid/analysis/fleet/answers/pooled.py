"""The population of one kind of output as the report and the tables have it: in the parameters' own units, by driver."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from canid.analysis.fleet.answers.estimates import Selection
from canid.analysis.fleet.answers.labels import unit
from canid.analysis.fleet.one_log.plain_values import interval_columns
from canid.analysis.fleet.storage.columns import natural
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.population import drive_table as tables
from canid.mathematics.population import hierarchical
from canid.mathematics.population.drive_table import DriveTable
from canid.values.fleet_summary import Driver, Kind, Parameter, Population
from canid.values.types import NAN, Array, Interval


def population(selections: tuple[Selection, ...], pools: tuple[hierarchical.Population, ...]) -> Population:
    """Put the pools of one kind of output together.

    Args:
        selections: the same drives with different parameters, such as `estimates.MAIN` and `estimates.TIMES`.
        pools: `hierarchical.pool` of each.
    """
    kind = selections[0].kind
    parameters: list[Parameter] = []
    shrunken: dict[str, dict[str, Interval]] = {}
    own_estimates: dict[str, dict[str, Interval]] = {}
    for selection, pool in zip(selections, pools, strict=True):
        parameters += _parameters(pool, kind)
        for driver, name, value in _of_drivers(
            pool.drivers, pool.names, *pool.driver[:3], known=_known_by(selection)
        ):
            shrunken.setdefault(driver, {})[name] = value
        for driver, name, value in _own(selection.table, pool):
            own_estimates.setdefault(driver, {})[name] = value
    main = selections[0]
    drives = np.bincount(main.table.driver, minlength=len(main.table.drivers))
    usable = np.bincount(main.table.driver, np.nan_to_num(main.usable), minlength=len(main.table.drivers))
    drivers = tuple(
        Driver(name, int(drives[k]), float(usable[k]), shrunken.get(name, {}), own_estimates.get(name, {}))
        for k, name in enumerate(main.table.drivers)
    )
    of_pools = [line for pool in pools if pool.counts.any() for line in pool.says]
    says = tuple(dict.fromkeys([*main.withheld, *of_pools]))
    return Population(kind, tuple(parameters), drivers, (), says, ())


def on_its_scale(name: str, iv: Interval) -> Interval:
    """Of a logarithm, the parameter itself.

    Example:
        >>> on_its_scale("x.log_tau", Interval(0.0, 0.0, 0.0)), on_its_scale("x.K", Interval(0.5, 0.4, 0.6))
        (Interval(value=1.0, low=1.0, high=1.0), Interval(value=0.5, low=0.4, high=0.6))
    """
    if not natural(name)[1]:
        return iv
    return Interval(*(math.exp(x) if x < 700.0 else math.inf if x == x else NAN for x in iv))


def own_estimates(table: DriveTable, within: Array) -> tuple[Array, Array]:
    """Each driver's generalised least squares mean, of his own drives alone.

    A drive weighs by the inverse of S + W: its own error, and the spread between drives of one driver.

    Args:
        table: n drives of p parameters.
        within: (p, p) W; NaN: not known, then 0.

    Returns:
        Mean and standard deviation, (I, p) each; NaN where the driver's drives do not know the parameter.

    Example:
        >>> of = tables.drive_table(("K",), np.array([[1.0], [3.0]]), np.ones((2, 1)), ("anna", "anna"))
        >>> mean, sd = own_estimates(of, np.ones((1, 1)))
        >>> float(mean[0, 0]), float(sd[0, 0])
        (2.0, 1.0)
    """
    known = tables.known(table)
    drivers, p = len(table.drivers), len(table.names)
    information, weighted = np.zeros((drivers, p, p)), np.zeros((drivers, p))
    both = known[:, :, None] & known[:, None, :]
    # what is not known has the identity in its place, which no known parameter is coupled to
    variance = np.where(both, table.covariance + np.nan_to_num(within), np.eye(p))
    precision = np.where(both, np.linalg.inv(variance), 0.0)
    np.add.at(information, table.driver, precision)
    y = np.where(known, table.estimate, 0.0)
    np.add.at(weighted, table.driver, np.einsum("nij,nj->ni", precision, y))
    has = np.einsum("ikk->ik", information) > 0.0
    filled = np.where(has[:, :, None] & has[:, None, :], information, np.eye(p))
    covariance = np.linalg.inv(filled)
    mean = np.einsum("ijk,ik->ij", covariance, weighted)
    sd = np.sqrt(np.einsum("ikk->ik", covariance))
    return np.where(has, mean, NAN), np.where(has, sd, NAN)


def _parameters(pool: hierarchical.Population, kind: Kind) -> list[Parameter]:
    out = []
    for k, name in enumerate(pool.names):
        log = natural(name)[1]
        mean, between, within, new = (
            Interval(*(float(x[k]) for x in quantity[:3]))
            for quantity in (pool.mean, pool.between, pool.within, pool.new_driver)
        )
        drives, drivers = (int(x) for x in pool.counts[k])
        out.append(
            Parameter(
                name, unit(name, kind), log, drivers, drives, on_its_scale(name, mean), between, within,
                on_its_scale(name, new), pool.status[k],
            )
        )  # fmt: skip
    return out


def _known_by(selection: Selection) -> Array:
    """Drivers and the parameters that any drive of theirs knows, (I, p): without one the estimate is the population's."""
    table = selection.table
    has = np.zeros((len(table.drivers), len(table.names)))
    np.add.at(has, table.driver, tables.known(table).astype(np.float64))
    return has


def _own(table: DriveTable, pool: hierarchical.Population) -> Iterator[tuple[str, str, Interval]]:
    within = pool.within.covariance
    mean, sd = own_estimates(table, within)
    half = NORMAL_QUANTILE * sd
    return _of_drivers(
        table.drivers, table.names, mean, mean - half, mean + half, known=np.isfinite(mean).astype(np.float64)
    )


def _of_drivers(
    drivers: tuple[str, ...], names: tuple[str, ...], value: Array, low: Array, high: Array, *, known: Array
) -> Iterator[tuple[str, str, Interval]]:
    for i, driver in enumerate(drivers):
        for k, name in enumerate(names):
            if known[i, k] > 0.0 and math.isfinite(value[i, k]):
                iv = Interval(float(value[i, k]), float(low[i, k]), float(high[i, k]))
                yield driver, name, on_its_scale(name, iv)


def driver_row(population: Population, driver: Driver) -> Mapping[str, object]:
    """A row of `columns.DRIVERS`."""
    row: dict[str, object] = {
        "driver": driver.name,
        "output": population.kind.output,
        "unit": population.kind.unit,
        "car": population.kind.car,
        "drives": driver.drives,
        "usable": driver.usable,
    }
    for end, values in (("", driver.shrunken), ("_own", driver.own)):
        for name, iv in values.items():
            row |= interval_columns(f"{natural(name)[0]}{end}", iv)
    return row


def parameter_row(population: Population, parameter: Parameter) -> Mapping[str, object]:
    """A row of `columns.POPULATION`."""
    return {
        "output": population.kind.output,
        "unit": population.kind.unit,
        "car": population.kind.car,
        "parameter": natural(parameter.name)[0],
        "relative": parameter.log,
        "drivers": parameter.drivers,
        "drives": parameter.drives,
        **interval_columns("mean", parameter.mean),
        **interval_columns("between", parameter.between),
        **interval_columns("within", parameter.within),
        **interval_columns("new_driver", parameter.new_driver),
        "says": parameter.says,
    }
