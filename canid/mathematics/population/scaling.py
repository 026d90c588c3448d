"""Units in which the prior of the spread has the scale 1: estimates of any unit and size then have the same results.

The centre of a parameter is the median of its better known half of the estimates, its unit their whole spread: the median
absolute deviation, which outliers do not move, and the median sampling error, in squares.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.population.drive_table import DriveTable, Flags, Index
from canid.mathematics.population.gibbs import Data
from canid.values.types import Array

# median absolute deviation -> standard deviation of a normal distribution
NORMAL_MAD = 1.4826
# least eigenvalue of a sampling correlation matrix: a covariance that round-off made indefinite is mended
LEAST_EIGENVALUE = 1e-8
# sampling error, in units, beyond which an estimate says nothing: larger ones only cost digits
LARGEST_ERROR = 1e5


class Units(NamedTuple):
    """Of p parameters."""

    centre: Array  # (p,)
    size: Array  # (p,)


def units(table: DriveTable, known: Flags) -> Units:
    """Centre and unit of each parameter.

    Args:
        table: n drives.
        known: (n, p).

    Returns:
        Centre 0 and unit 1 where nothing is known.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> table = drive_table(("K",), np.array([[4.0], [5.0], [6.0], [900.0]]), np.full((4, 1), 0.01), tuple("abcd"))
        >>> [round(float(x[0]), 1) for x in units(table, np.ones((4, 1), bool))]
        [5.5, 1.5]
    """
    p = len(table.names)
    centre, size = np.zeros(p), np.ones(p)
    for k in range(p):
        knows = known[:, k]
        if not knows.any():
            continue
        y, v = table.estimate[knows, k], table.covariance[knows, k, k]
        # of few estimates all that are as well known as the second: one alone has no spread
        limit = max(float(np.median(v)), float(np.sort(v)[:2][-1]))
        best = v <= limit
        centre[k] = np.median(y[best])
        deviation = NORMAL_MAD * float(np.median(np.abs(y[best] - centre[k])))
        unit = np.hypot(deviation, np.sqrt(np.median(v[best])))
        # the same estimate everywhere and without an error: any unit serves
        size[k] = unit if unit > 0.0 else max(abs(centre[k]), 1.0)
    return Units(centre, size)


def data(table: DriveTable, known: Flags, order: Index, column: Index, units: Units) -> tuple[Data, Index]:
    """What the sampler takes, of one chain.

    Args:
        table: n drives.
        known: (n, p).
        order: places of the drives that know something, in ascending order of drivers.
        column: places of the parameters that some drive knows.
        units: of `units`.

    Returns:
        Data with one group, and the places of the drivers that have drives.

    Example:
        >>> from canid.mathematics.population.drive_table import drive_table
        >>> table = drive_table(("K",), np.array([[4.0], [6.0]]), np.ones((2, 1)), ("a", "b"))
        >>> known, both = np.ones((2, 1), bool), np.arange(2)
        >>> prepared, present = data(table, known, both, np.arange(1), units(table, known))
        >>> prepared.y.shape, present.tolist()
        ((1, 1, 2), [0, 1])
    """
    has = known[order][:, column]
    unit = units.size[column]
    y = np.where(has, (table.estimate[order][:, column] - units.centre[column]) / unit, 0.0)
    s = table.covariance[order][:, column][:, :, column] / (unit[:, None] * unit[None, :])
    both = has[:, :, None] & has[:, None, :]
    s = _mended(np.where(both, np.nan_to_num(s), 0.0), has)
    present, driver = np.unique(table.driver[order], return_inverse=True)
    return (
        Data(
            y.T[:, None, :],
            np.moveaxis(s, 0, -1)[:, :, None, :],
            np.ascontiguousarray(has.T[:, None, :]),
            driver.astype(np.intp),
            np.zeros(len(order), dtype=np.intp),
        ),
        present.astype(np.intp),
    )


def _mended(s: Array, has: Flags) -> Array:
    """Covariances with correlations of a positive definite matrix, and errors that are not beyond the largest."""
    sd = np.sqrt(np.einsum("nkk->nk", s))
    bounded = np.where(has, np.minimum(sd, LARGEST_ERROR), 0.0)
    inverse = np.where(sd > 0.0, 1.0 / np.where(sd > 0.0, sd, 1.0), 0.0)
    correlation = s * inverse[:, :, None] * inverse[:, None, :]
    place = np.arange(s.shape[1])
    correlation[:, place, place] = 1.0
    value, vector = np.linalg.eigh(0.5 * (correlation + correlation.swapaxes(1, 2)))
    mended = np.einsum("nkm,nm,nlm->nkl", vector, np.maximum(value, LEAST_EIGENVALUE), vector)
    return np.asarray(mended * bounded[:, :, None] * bounded[:, None, :])
