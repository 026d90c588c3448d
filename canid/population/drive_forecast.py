"""Expected gain of one more drive: how much narrower a driver's interval becomes, from S and W alone.

The posterior covariance of a driver's parameters is (Q + B^-1)^-1 with Q the sum of (S + W)^-1 over the drives; one drive
more adds another term (the value of a design is known before its data: Chaloner & Verdinelli 1995, of linear models). A
coming drive is taken to be as good as the driver's median one, or the fleet's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.identification.confidence import NORMAL_QUANTILE
from canid.population import weighted_drives
from canid.population.batched_inverse import inverse
from canid.population.drive_table import DriveTable, Index
from canid.population.hierarchical import Population
from canid.types import Array


class Forecast(NamedTuple):
    """One driver and one parameter."""

    driver: str
    parameter: str
    width: float  # of the 95 % interval today
    expected: float  # after one more drive of the driver
    gain: float  # by how much narrower, as a share of the spread between drivers (95 % range)
    drives: int  # of the driver that know the parameter


def forecasts(table: DriveTable, population: Population) -> tuple[Forecast, ...]:
    """What to drive next: drivers and parameters, those that gain most first.

    Args:
        table: n drives.
        population: of it.

    Returns:
        None for parameters whose spread between drivers is not known; () where there are none.

    Raises:
        ValueError: the population is that of another table.

    Example:
        >>> from canid.population.drive_table import drive_table
        >>> from canid.population.hierarchical import pool
        >>> gain = np.array([3.0, 3.1, 3.05, 4.0, 4.1, 4.05, 5.0])
        >>> table = drive_table(("K",), gain[:, None], np.full((7, 1), 0.04), ("a", "a", "a", "b", "b", "b", "c"))
        >>> of = forecasts(table, pool(table))
        >>> of[0].driver, of[0].expected < of[0].width
        ('c', True)
    """
    of = weighted_drives.prepare(table, population)
    if of is None:
        return ()
    outer = of.unit[:, None] * of.unit[None, :]
    square = np.ix_(of.column, of.column)
    between, within = (
        np.nan_to_num(x.covariance[square]) / outer for x in (population.between, population.within)
    )
    sd = population.between.value[of.column]
    known = np.isfinite(sd)
    # what has no spread between drivers keeps a wide one here and is not listed
    between = between + np.diag(np.where(known, 0.0, 1.0))
    ahead = weighted_drives.information(of, within)
    q = np.add.reduceat(ahead, of.first, axis=-1)
    b_inverse = np.linalg.inv(between)[..., None]
    now = inverse(q + b_inverse)
    then = inverse(q + b_inverse + _coming(of, within))
    counts = np.add.reduceat(of.known.astype(np.intp), of.first, axis=-1)
    width, expected = (
        2.0 * NORMAL_QUANTILE * np.sqrt(np.einsum("kki->ki", x)) * of.unit[:, None] for x in (now, then)
    )
    out = [
        Forecast(
            table.drivers[driver],
            table.names[of.column[k]],
            float(width[k, i]),
            float(expected[k, i]),
            float((width[k, i] - expected[k, i]) / (2.0 * NORMAL_QUANTILE * sd[k])),
            int(counts[k, i]),
        )
        for i, driver in enumerate(of.present)
        for k in np.flatnonzero(known)
    ]
    return tuple(sorted(out, key=lambda one: -one.gain))


def _coming(of: weighted_drives.WeightedDrives, within: Array) -> Array:
    """Information of a coming drive of each driver, (k, k, I'): of an independent error as large as the median one."""
    variance = np.einsum("kkn->kn", of.s)
    fleet = np.array(
        [np.median(v[has]) if has.any() else np.inf for v, has in zip(variance, of.known, strict=True)]
    )
    typical = np.tile(fleet[:, None], len(of.first))
    ends: Index = np.append(of.first, len(of.order)).astype(np.intp)
    for i in range(len(of.first)):
        part = slice(ends[i], ends[i + 1])
        for k in range(len(variance)):
            has = of.known[k, part]
            if has.any():
                typical[k, i] = np.median(variance[k, part][has])
    error = np.eye(len(variance))[..., None] * typical[:, None, :]
    return inverse(error + within[..., None])
