"""Expected gain of one more drive: how much narrower a driver's interval becomes, from S and W alone.

The posterior covariance of a driver's parameters is (Q + B^-1)^-1 with Q the sum of (S + W)^-1 over the drives; one drive
more adds another term (the value of a design is known before its data: Chaloner & Verdinelli 1995, of linear models). A
coming drive is taken to be as good as the driver's median one, or the fleet's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.population import weighted_drives
from canid.mathematics.population.batched_inverse import inverse
from canid.mathematics.population.drive_table import DriveTable, Index
from canid.mathematics.population.hierarchical import Population
from canid.values.types import Array


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
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> from canid.mathematics.population.hierarchical import pool
        >>> gain = np.array([3.0, 3.1, 3.05, 4.0, 4.1, 4.05, 5.0])
        >>> table = drive_table(("K",), gain[:, None], np.full((7, 1), 0.04), ("a", "a", "a", "b", "b", "b", "c"))
        >>> forecast = forecasts(table, pool(table))
        >>> forecast[0].driver, forecast[0].expected < forecast[0].width
        ('c', True)
    """
    weighted = weighted_drives.prepare(table, population)
    if weighted is None:
        return ()
    between, within = (
        np.nan_to_num(weighted_drives.scaled(weighted, x.covariance))
        for x in (population.between, population.within)
    )
    sd = population.between.value[weighted.column]
    known = np.isfinite(sd)
    # what has no spread between drivers keeps a wide one here and is not listed
    between = between + np.diag(np.where(known, 0.0, 1.0))
    ahead = weighted_drives.information(weighted, within)
    q = np.add.reduceat(ahead, weighted.first, axis=-1)
    b_inverse = np.linalg.inv(between)[..., None]
    now = inverse(q + b_inverse)
    then = inverse(q + b_inverse + _coming(weighted, within))
    counts = np.add.reduceat(weighted.known.astype(np.intp), weighted.first, axis=-1)
    width, expected = (
        2.0 * NORMAL_QUANTILE * np.sqrt(np.einsum("kki->ki", x)) * weighted.unit[:, None] for x in (now, then)
    )
    out = [
        Forecast(
            table.drivers[driver],
            table.names[weighted.column[k]],
            float(width[k, i]),
            float(expected[k, i]),
            float((width[k, i] - expected[k, i]) / (2.0 * NORMAL_QUANTILE * sd[k])),
            int(counts[k, i]),
        )
        for i, driver in enumerate(weighted.present)
        for k in np.flatnonzero(known)
    ]
    return tuple(sorted(out, key=lambda forecast: -forecast.gain))


def _coming(weighted: weighted_drives.WeightedDrives, within: Array) -> Array:
    """Information of a coming drive of each driver, (k, k, I'): of an independent error as large as the median one."""
    variance = np.einsum("kkn->kn", weighted.s)
    fleet = np.array(
        [np.median(v[has]) if has.any() else np.inf for v, has in zip(variance, weighted.known, strict=True)]
    )
    typical = np.tile(fleet[:, None], len(weighted.first))
    ends: Index = np.append(weighted.first, len(weighted.order)).astype(np.intp)
    for i in range(len(weighted.first)):
        part = slice(ends[i], ends[i + 1])
        for k in range(len(variance)):
            has = weighted.known[k, part]
            if has.any():
                typical[k, i] = np.median(variance[k, part][has])
    error = np.eye(len(variance))[..., None] * typical[:, None, :]
    return inverse(error + within[..., None])
