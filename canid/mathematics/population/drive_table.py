"""Estimates of many drives of many drivers, with the covariances of their errors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.types import Array

Flags = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


class DriveTable(NamedTuple):
    """Of n drives and p parameters. NaN: not known from that drive."""

    names: tuple[str, ...]  # (p,) parameters, such as "range_rate.K" or "range_rate.log_tau_plus_dead_time"
    estimate: Array  # (n, p)
    covariance: Array  # (n, p, p) of the estimate's error; rows and columns of what is not known are NaN
    driver: Index  # (n,) places in `drivers`
    drivers: tuple[str, ...]
    drives: tuple[str, ...]  # (n,) names
    start: Array  # (n,) s since 1970; NaN: not known
    group: tuple[str, ...]  # (n,) such as a setting of the ACC; "": none
    car: tuple[str, ...]  # (n,)


def drive_table(
    names: tuple[str, ...],
    estimate: Array,
    covariance: Array,
    driver: tuple[str, ...],
    *,
    drives: tuple[str, ...] = (),
    start: Array | None = None,
    group: tuple[str, ...] = (),
    car: tuple[str, ...] = (),
) -> DriveTable:
    """Make a table of drivers' names.

    Args:
        names: (p,).
        estimate: (n, p).
        covariance: (n, p, p), or (n, p) variances.
        driver: (n,) name of each drive's driver.
        drives: (n,) names; (): "drive 1", ...
        start: (n,) s since 1970.
        group: (n,).
        car: (n,).

    Raises:
        ValueError: shapes do not fit each other, or a covariance is none.

    Example:
        >>> table = drive_table(("K",), np.ones((2, 1)), np.ones((2, 1)), ("anna", "ben"))
        >>> table.driver.tolist(), table.drivers, table.drives
        ([0, 1], ('anna', 'ben'), ('drive 1', 'drive 2'))
    """
    estimate = np.asarray(estimate, dtype=np.float64)
    covariance = np.asarray(covariance, dtype=np.float64)
    if covariance.ndim == 2:
        diagonal = np.eye(covariance.shape[1]) > 0.0
        covariance = np.where(diagonal, covariance[:, None, :], 0.0)
    # numpy's strings are no strings for JSON
    driver = tuple(str(name) for name in driver)
    n = len(driver)
    drivers = tuple(dict.fromkeys(driver))
    place = {name: k for k, name in enumerate(drivers)}
    table = DriveTable(
        tuple(names),
        estimate,
        covariance,
        np.array([place[name] for name in driver], dtype=np.intp),
        drivers,
        tuple(drives) or tuple(f"drive {k + 1}" for k in range(n)),
        np.full(n, np.nan) if start is None else np.asarray(start, dtype=np.float64),
        tuple(group) or ("",) * n,
        tuple(car) or ("",) * n,
    )
    check(table)
    return table


def check(table: DriveTable) -> None:
    """Refuse a table whose columns do not fit each other.

    Raises:
        ValueError: it names the column and its shape.

    Example:
        >>> table = drive_table(("K",), np.ones((2, 1)), np.ones((2, 1)), ("anna", "ben"))
        >>> check(table._replace(drives=("one",)))
        Traceback (most recent call last):
        ...
        ValueError: drives has 1 entries, but estimate has 2 rows: give one per drive
    """
    n, p = len(table.driver), len(table.names)
    if table.estimate.shape != (n, p):
        raise ValueError(
            f"estimate has the shape {table.estimate.shape}: give (drives, names), here {(n, p)}"
        )
    if table.covariance.shape != (n, p, p):
        raise ValueError(f"covariance has the shape {table.covariance.shape}: give {(n, p, p)}")
    for column in ("drives", "start", "group", "car"):
        entries = len(getattr(table, column))
        if entries != n:
            raise ValueError(f"{column} has {entries} entries, but estimate has {n} rows: give one per drive")
    if n and not (int(table.driver.min()) >= 0 and int(table.driver.max()) < len(table.drivers)):
        raise ValueError("driver has a place that is not in drivers: give 0 to len(drivers) - 1")


def known(table: DriveTable) -> Flags:
    """What is known from each drive: an estimate with a variance that is a positive number.

    Returns:
        (n, p).

    Example:
        >>> table = drive_table(("K",), np.array([[1.0], [np.nan]]), np.ones((2, 1)), ("anna", "ben"))
        >>> known(table).tolist()
        [[True], [False]]
    """
    variance = np.einsum("nkk->nk", table.covariance)
    return np.asarray(np.isfinite(table.estimate) & np.isfinite(variance) & (variance >= 0.0), dtype=np.bool_)


def rows(table: DriveTable, keep: Flags | Index) -> DriveTable:
    """Some drives of a table; drivers without a drive stay in `drivers`.

    Args:
        table: n drives.
        keep: (n,) flags, or places.

    Example:
        >>> table = drive_table(("K",), np.ones((2, 1)), np.ones((2, 1)), ("anna", "ben"))
        >>> rows(table, np.array([False, True])).drives
        ('drive 2',)
    """
    places = np.flatnonzero(keep) if keep.dtype == np.bool_ else keep
    return table._replace(
        estimate=table.estimate[places],
        covariance=table.covariance[places],
        driver=table.driver[places],
        drives=tuple(table.drives[k] for k in places),
        start=table.start[places],
        group=tuple(table.group[k] for k in places),
        car=tuple(table.car[k] for k in places),
    )
