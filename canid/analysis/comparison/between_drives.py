"""Two means of several drives each, with the spread between drives of one driver (random effects, one for both sides).

The spread by Paule & Mandel 1982 (Journal of Research of the NBS 87, 377): the one at which the weighted sum of squares
about the two means is its degrees of freedom. Intervals by Student's t with as many (Knapp & Hartung 2003): of few drives
the spread is hardly known, and two a side say little. One drive a side has no spread: then drives are compared, not drivers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student_t

from canid.analysis.comparison import difference
from canid.mathematics.identification.confidence import NORMAL_QUANTILE, QUANTILES
from canid.values.types import NAN, Array, Interval

BISECTIONS = 60


class Contrast(NamedTuple):
    """One parameter on both sides."""

    a: Interval
    b: Interval
    spread: float  # sd between drives of one driver; NaN: one drive a side
    freedom: float  # degrees of freedom; inf: none were estimated

    def difference(self, stretch: float = NORMAL_QUANTILE) -> Interval:
        """Interval of b - a, `stretch` standard deviations to each side."""
        return difference.difference(self.a, self.b, self._of_normal(stretch))

    def ratio(self, stretch: float = NORMAL_QUANTILE) -> Interval:
        """Interval of b / a."""
        return difference.ratio(self.a, self.b, self._of_normal(stretch))

    @property
    def z(self) -> float:
        """Standard normal score of the difference."""
        raw = difference.z_score(difference.difference(self.a, self.b))
        if math.isinf(self.freedom) or math.isinf(raw):
            return raw
        # the sides' intervals are t quantiles wide; back to a t statistic, and from its tail to a normal score
        statistic = raw / NORMAL_QUANTILE * float(student_t.ppf(QUANTILES[1], self.freedom))
        return math.copysign(float(norm.isf(student_t.sf(abs(statistic), self.freedom))), statistic)

    def _of_normal(self, stretch: float) -> float:
        """Half-width of the sides' 95 % intervals -> that of the level whose normal half-width is `stretch`."""
        if math.isinf(self.freedom):
            return stretch / NORMAL_QUANTILE
        wanted = float(student_t.isf(norm.sf(stretch), self.freedom))
        return wanted / float(student_t.ppf(QUANTILES[1], self.freedom))


def contrast(a: Sequence[Interval], b: Sequence[Interval]) -> Contrast:
    """Means of both sides.

    Args:
        a: one or more drives' estimates, all finite.
        b: of the other side.

    >>> each = [Interval(x, x - 0.2, x + 0.2) for x in (5.0, 6.0, 7.0)]
    >>> compared = contrast(each[:1] * 3, each)
    >>> round(compared.spread, 1), compared.freedom, round(compared.b.value, 1), abs(compared.z) < 2.0
    (0.7, 4, 6.0, True)
    """
    if len(a) == len(b) == 1:
        return Contrast(a[0], b[0], NAN, math.inf)
    sides = [np.array(side, dtype=np.float64) for side in (a, b)]
    freedom = len(a) + len(b) - 2
    variances = [((side[:, 2] - side[:, 1]) / (2.0 * NORMAL_QUANTILE)) ** 2 for side in sides]
    spread = _spread([side[:, 0] for side in sides], variances, freedom)
    quantile = float(student_t.ppf(QUANTILES[1], freedom))
    out = []
    for side, variance in zip(sides, variances, strict=True):
        weight = 1.0 / np.maximum(variance + spread**2, 1e-300)
        mean, half = float(weight @ side[:, 0] / weight.sum()), quantile * float(weight.sum()) ** -0.5
        out.append(Interval(mean, mean - half, mean + half))
    return Contrast(out[0], out[1], spread, freedom)


def _spread(values: Sequence[Array], variances: Sequence[Array], freedom: int) -> float:
    """Standard deviation between drives; 0 where the drives' own errors explain all scatter."""

    def squares(between: float) -> float:
        total = 0.0
        for y, v in zip(values, variances, strict=True):
            w = 1.0 / np.maximum(v + between, 1e-300)
            total += float(w @ (y - float(w @ y / w.sum())) ** 2)
        return total

    if squares(0.0) <= freedom:
        return 0.0
    low, high = 0.0, max(float(np.ptp(y)) ** 2 for y in values) + 1e-300
    while squares(high) > freedom:
        high *= 2.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if squares(middle) > freedom else (low, middle)
    return math.sqrt(high)
