"""Value of a signal at one instant by a local polynomial through its readings (Savitzky & Golay 1964, any spacing).

Plain floats: some ten readings are too few for calls of numpy, and the sums do not depend on what else is in memory.
"""

from __future__ import annotations

from collections.abc import Sequence

from canid.types import NAN


def line(x: Sequence[float], y: Sequence[float]) -> float:
    """Least-squares line at x = 0; NaN below two readings.

    >>> line([-0.03, -0.02, -0.01], [1.0, 2.0, 3.0])
    4.0
    """
    n = len(x)
    if n < 2:
        return NAN
    mx, my = sum(x) / n, sum(y) / n
    sxx = sum([(a - mx) ** 2 for a in x])
    sxy = sum([(a - mx) * (b - my) for a, b in zip(x, y, strict=True)])
    return my - sxy / sxx * mx if sxx > 0.0 else NAN


def parabola(x: Sequence[float], y: Sequence[float]) -> float:
    """Least-squares parabola at x = 0; NaN below four readings, or where 0 is not among them.

    >>> round(parabola([-0.2, -0.1, 0.1, 0.2], [1.04, 1.01, 1.01, 1.04]), 9)
    1.0
    """
    n = len(x)
    if n < 4 or not x[0] <= 0.0 <= x[-1]:
        return NAN
    scale = x[-1] - x[0]
    u = [a / scale for a in x]
    s1, s2 = sum(u), sum([a * a for a in u])
    s3, s4 = sum([a**3 for a in u]), sum([a**4 for a in u])
    # Cramer's rule for the constant of the normal equations
    c0, c1, c2 = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    size = n * c0 + s1 * c1 + s2 * c2
    if not size > 0.0:
        return NAN
    r0, r1 = sum(y), sum([a * b for a, b in zip(u, y, strict=True)])
    r2 = sum([a * a * b for a, b in zip(u, y, strict=True)])
    return (r0 * c0 + r1 * c1 + r2 * c2) / size
