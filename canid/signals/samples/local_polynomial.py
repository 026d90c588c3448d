"""Value of a signal at one instant by a local polynomial through its readings (Savitzky & Golay 1964, any spacing).

Plain floats: some ten readings are too few for calls of numpy, and the sums do not depend on what else is in memory.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

import numpy as np

from canid.values.types import NAN, Array

# of the time in which noise of a density and white jerk of 1 (m/s³)²·s weigh the same, (density/jerk)^1/4: half the width
# of a parabola through a vehicle's speed. With noise of 0.04 and 0.08 m/s at 10 Hz, a lag came out 0.07 and 0.19 s too long
# behind a half width of 0.25 s, 0.02 and 0.05 s behind 0.5 and 0.8 s, which this is about
HALF_WIDTHS = 5.0


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
    u, v = [a - mx for a in x], [b - my for b in y]
    sxx = sum(map(mul, u, u))
    if not sxx > 0.0:
        return Fitted()
    slope = sum(map(mul, u, v)) / sxx
    if n == 2:
        return Fitted(my - slope * mx)
    left = [b - slope * a for a, b in zip(u, v, strict=True)]
    rest = sum(map(mul, left, left)) / (n - 2)
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
    square = [a * a for a in u]
    s1, s2 = sum(u), sum(square)
    s3, s4 = sum([a**3 for a in u]), sum([a**4 for a in u])
    # the normal equations by Cramer's rule
    c0, c1, c2 = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    size = n * c0 + s1 * c1 + s2 * c2
    if not size > 0.0:
        return Fitted()
    # about the mean, so that no square drowns the readings' scatter
    mean = sum(y) / n
    v = [b - mean for b in y]
    r1, r2 = sum(map(mul, u, v)), sum(map(mul, square, v))
    p0 = (r1 * c1 + r2 * c2) / size
    p1 = (r1 * (n * s4 - s2 * s2) + r2 * (s1 * s2 - n * s3)) / size
    p2 = (r1 * (s1 * s2 - n * s3) + r2 * (n * s2 - s1 * s1)) / size
    left = [b - p0 - p1 * a - p2 * a * a for a, b in zip(u, v, strict=True)]
    return Fitted(mean + p0, sum(map(mul, left, left)) / (n - 3) * c0 / size)


def noise(t: Array, y: Array) -> Array:
    """What each reading shows of the variance of noise: the square of its distance from the line between its neighbours.

    Args:
        t: (n,) s, ascending.
        y: (n,) readings; the first and the last show nothing, and are 0.

    >>> noise(np.array([0.0, 1.0, 3.0]), np.array([1.0, 2.0, 4.0])).tolist()
    [0.0, 0.0, 0.0]
    """
    out = np.zeros(len(y))
    if len(y) > 2:
        first = (t[2:] - t[1:-1]) / (t[2:] - t[:-2])
        left = y[1:-1] - first * y[:-2] - (1.0 - first) * y[2:]
        out[1:-1] = left * left / (1.0 + first * first + (1.0 - first) ** 2)
    return out


def smooth(x: Sequence[float], y: Sequence[float], squares: Sequence[float], least: float) -> Fitted:
    """Parabola at x = 0 through a speed, as wide as its noise asks.

    Args:
        x: (n,) s.
        y: (n,) m/s.
        squares: (n,) (m/s)², from `noise`; () for no more than `least`.
        least: s, half the width at least.

    >>> x, y = [0.1 * k for k in range(-8, 9)], [9.08, 8.92] * 8 + [9.08]
    >>> squares = noise(np.array(x), np.array(y)).tolist()
    >>> abs(smooth(x, y, squares, 0.2).value - 9.0) < 0.5 * abs(parabola(x[6:11], y[6:11]).value - 9.0)
    True
    """
    half, inner = least, squares[1:-1]
    if inner:
        density = sum(inner) / len(inner) * (x[-1] - x[0]) / (len(x) - 1)
        half = max(HALF_WIDTHS * density**0.25, least)
    first, end = bisect_left(x, -half), bisect_left(x, half)
    return parabola(x[first:end], y[first:end])
