"""Value of a signal at one instant by a local polynomial through its readings (Savitzky & Golay 1964, any spacing).

Plain floats: some ten readings are too few for calls of numpy, and the sums do not depend on what else is in memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from canid.types import NAN


class Fitted(NamedTuple):
    """The polynomial at x = 0, and the variance of that by the scatter of the readings; NaN: not known."""

    value: float = NAN
    variance: float = NAN


def line(x: Sequence[float], y: Sequence[float]) -> Fitted:
    """Least-squares line at x = 0; NaN below two readings.

    >>> line([-2.0, -1.0], [1.0, 2.0])
    Fitted(value=3.0, variance=nan)
    """
    n = len(x)
    if n < 2:
        return Fitted()
    mx, my = sum(x) / n, sum(y) / n
    sxx = sum([(a - mx) ** 2 for a in x])
    if not sxx > 0.0:
        return Fitted()
    slope = sum([(a - mx) * (b - my) for a, b in zip(x, y, strict=True)]) / sxx
    if n == 2:
        return Fitted(my - slope * mx)
    rest = sum([(b - my - slope * (a - mx)) ** 2 for a, b in zip(x, y, strict=True)]) / (n - 2)
    return Fitted(my - slope * mx, rest * (1.0 / n + mx * mx / sxx))


def parabola(x: Sequence[float], y: Sequence[float]) -> Fitted:
    """Least-squares parabola at x = 0; NaN below four readings, or where 0 is not among them.

    >>> round(parabola([-0.2, -0.1, 0.1, 0.2], [1.04, 1.01, 1.01, 1.04]).value, 9)
    1.0
    """
    n = len(x)
    if n < 4 or not x[0] <= 0.0 <= x[-1]:
        return Fitted()
    scale = x[-1] - x[0]
    u = [a / scale for a in x]
    s1, s2 = sum(u), sum([a * a for a in u])
    s3, s4 = sum([a**3 for a in u]), sum([a**4 for a in u])
    # the normal equations by Cramer's rule
    c0, c1, c2 = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    size = n * c0 + s1 * c1 + s2 * c2
    if not size > 0.0:
        return Fitted()
    # about the mean, so that no square drowns the readings' scatter
    mean = sum(y) / n
    r1 = sum([a * (b - mean) for a, b in zip(u, y, strict=True)])
    r2 = sum([a * a * (b - mean) for a, b in zip(u, y, strict=True)])
    p0 = (r1 * c1 + r2 * c2) / size
    p1 = (r1 * (n * s4 - s2 * s2) + r2 * (s1 * s2 - n * s3)) / size
    p2 = (r1 * (s1 * s2 - n * s3) + r2 * (n * s2 - s1 * s1)) / size
    rest = sum([(b - mean - p0 - p1 * a - p2 * a * a) ** 2 for a, b in zip(u, y, strict=True)]) / (n - 3)
    return Fitted(mean + p0, rest * c0 / size)
