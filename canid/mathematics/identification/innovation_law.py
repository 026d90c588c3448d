"""The law of a noise's innovations: Student's t with a scale that follows what has happened, Gaussian as the limit.

People press a pedal in bursts: innovations have heavy tails (3 to 5 degrees of freedom) and come in clusters. Least
squares weighs each by its own variance then: a scale that depends on the past alone, and the weight of Student's t, the
expected precision of the scale mixture (Lange, Little & Taylor 1989).
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import first_order
from canid.values.types import Array

# degrees of freedom that are compared
FREEDOMS = (math.inf, 40.0, 20.0, 12.0, 8.0, 6.0, 4.5, 3.5, 2.75, 2.2)
# What a heavier tail must add to the log likelihood: with less the Gaussian stays. In 600 values of a Gaussian the tail
# parameter alone adds more once in 60.
TAIL_LEAST = 2.5
# The same for the scale's two slopes (chi-squared, two degrees of freedom: once in 50)
SCALE_LEAST = 4.0
# log of the scale, at most, from its mean: a factor of 7 either way
MAX_LOG_SCALE = 2.0
# of log scale by a feature
MAX_SLOPE = 1.5
# s over which past innovations count
MEMORY_S = 4.0
ROUNDS = 2
# innovations below which a law is not looked for
MIN_ROWS = 100


class Law(NamedTuple):
    """e_t / (sd size_t) is Student's t."""

    freedom: float  # inf: Gaussian
    sd: float  # scale of Student's t at size 1
    slopes: Array  # (k,) of log size by the features; empty: one size

    @property
    def inflation(self) -> float:
        """Of variances: Fisher's information of Student's t is less than the weights suggest."""
        return (self.freedom + 3.0) / (self.freedom + 1.0) if math.isfinite(self.freedom) else 1.0

    @property
    def variance(self) -> float:
        """Of an innovation, over the squared scale."""
        return self.freedom / (self.freedom - 2.0) if math.isfinite(self.freedom) else 1.0

    @property
    def is_plain(self) -> bool:
        """Whether it is a Gaussian of one size: every innovation counts alike."""
        return not (math.isfinite(self.freedom) or len(self.slopes))


def is_possible(law: Law) -> bool:
    """Whether a law may have come from `fit`.

    >>> is_possible(Law(math.inf, 0.1, np.zeros(0))), is_possible(Law(1.0, 0.1, np.zeros(0)))
    (True, False)
    """
    slopes = np.asarray(law.slopes)
    whole = slopes.shape in ((0,), (2,)) and bool((np.abs(slopes) <= MAX_SLOPE).all())
    return law.freedom in FREEDOMS and 0.0 <= law.sd < math.inf and whole


class Weights(NamedTuple):
    """How each innovation counts."""

    law: Law
    size: Array  # (n,) of the scale, relative
    mixture: Array  # (n,) expected precision of Student's t, mean about 1

    @property
    def weight(self) -> Array:
        """(n,) of a squared innovation."""
        out: Array = self.mixture / (self.size * self.size)
        return out


def equal(n: int, sd: float = 1.0) -> Weights:
    """Weights of a Gaussian of one size."""
    return Weights(Law(math.inf, sd, np.zeros(0)), np.ones(n), np.ones(n))


def changes(y: Array, usable: npt.NDArray[np.bool_]) -> Array:
    """Return (n,) the size of a signal's change from two values ago to the last; where it is not known, the mean.

    >>> changes(np.array([0.0, 1.0, 4.0, 4.0]), np.full(4, True))
    array([2., 2., 1., 3.])
    """
    change, known = np.zeros(len(y)), np.zeros(len(y), bool)
    change[2:] = np.abs(y[1:-1] - y[:-2])
    known[2:] = usable[1:-1] & usable[:-2]
    change[~known] = float(change[known].mean()) if known.any() else 1.0
    return change


def features(e: Array, rows: npt.NDArray[np.bool_], change: Array, per_second: float) -> Array:
    """Return (2, n) what the scale may follow: past innovations, and the output's last change.

    Both are of the past alone, with mean 0 and variance 1 over the rows.

    Args:
        e: (n,) innovations.
        rows: (n,) where they count.
        change: (n,) size of the output's change from two values ago to the last.
        per_second: innovations in a second.
    """
    keep = math.exp(-1.0 / max(MEMORY_S * per_second, 1.0))
    weight = rows.astype(float)
    weight /= max(float(weight.sum()), 1.0)
    square = np.where(rows, e * e, 0.0)
    middle = float(square @ weight)
    square[~rows] = middle
    known = middle + first_order.scan((1.0 - keep) * (square - middle), np.array([keep]))
    recent = np.empty(len(e))
    recent[0], recent[1:] = middle, known[:-1]
    out = np.empty((2, len(e)))
    out[0], out[1] = recent + (1e-3 * middle + 1e-300), change + (0.25 * float(change @ weight) + 1e-300)
    np.log(out, out=out)
    out[0] *= 0.5
    out -= (out @ weight)[:, None]
    sd = np.sqrt((out * out) @ weight)
    out /= np.where(sd > 1e-9, sd, np.inf)[:, None]
    return out


def fit(
    e: Array, rows: npt.NDArray[np.bool_], features: Array, share: float = 1.0, before: Law | None = None
) -> Weights:
    """Fit the law by maximum likelihood.

    Args:
        e: (n,) innovations.
        rows: (n,) where they count.
        features: (k, n) features of the scale.
        share: of the rows, as many as are independent.
        before: a law to begin with.

    >>> rng = np.random.default_rng(0)
    >>> e, no = rng.standard_t(3, 4000), np.zeros((0, 4000))
    >>> found = fit(e, np.full(4000, True), no)
    >>> 2.5 < found.law.freedom < 3.6, abs(found.law.sd - 1.0) < 0.1
    (True, True)
    >>> fit(rng.normal(size=600), np.full(600, True), no[:, :600]).law.freedom
    inf
    """
    x, F = e[rows], features[:, rows]
    k = len(F)
    start = before if before is not None else Law(math.inf, 1.0, np.zeros(0))
    plain = _best(x, np.zeros(len(x)), share, start.freedom)
    freedom, sd, value = plain
    slopes = np.array(start.slopes) if len(start.slopes) == k else np.zeros(k)
    log_size = _log_size(slopes, F)
    total, squares = F.sum(axis=1), F @ F.T
    for _ in range(ROUNDS if k else 0):
        z2 = (x * np.exp(-log_size) / sd) ** 2
        heavy = math.isfinite(freedom)
        # d log likelihood / d log size, and Fisher's information of a log scale
        slope = F @ (
            (freedom + 1.0) / (freedom / np.maximum(z2, 1e-12) + 1.0) if heavy else np.minimum(z2, MAX_SQUARE)
        )
        slope -= total
        information = squares * (2.0 * freedom / (freedom + 3.0) if heavy else 2.0)
        information.flat[:: k + 1] += 1e-6 * len(x) + 1e-12
        step: Array = np.asarray(np.linalg.solve(information, slope), dtype=np.float64)
        slopes = _within(slopes + _within(step, 0.5), MAX_SLOPE)
        log_size = _log_size(slopes, F)
        freedom, sd, value = _best(x, log_size, share, freedom)
    if value < plain[2] + SCALE_LEAST:
        slopes, (freedom, sd, value) = np.zeros(k), plain
    return applied(e, Law(freedom, sd, slopes if slopes.any() else np.zeros(0)), features)


def weights(e: Array, law: Law, features: Array, rows: npt.NDArray[np.bool_]) -> Weights:
    """Weigh innovations by a law of which only the scale is fitted.

    Args:
        e: (n,) innovations.
        law: whose degrees of freedom and slopes are kept.
        features: (k, n) features of the scale.
        rows: (n,) where they count.
    """
    return log_likelihood(e, law, features, rows)[0]


def log_likelihood(e: Array, law: Law, features: Array, rows: npt.NDArray[np.bool_]) -> tuple[Weights, float]:
    """Weights as of `weights`, and the log likelihood of the innovations (n,) that count.

    >>> e = np.array([-1.0, 1.0])
    >>> _, value = log_likelihood(e, Law(math.inf, 9.0, np.zeros(0)), np.zeros((0, 2)), np.full(2, True))
    >>> round(value, 3)  # two values one standard deviation from the mean
    -2.838
    """
    size = _size(law, features, len(e))[rows]
    sd, value = _at((e[rows] / size) ** 2, law.freedom, 1.0, float(np.log(size).sum()))
    return applied(e, law._replace(sd=sd), features), value


def mixture(law: Law, e: float) -> float:
    """Return how a squared innovation counts under a law of one size.

    >>> mixture(Law(math.inf, 1.0, np.zeros(0)), 5.0), mixture(Law(4.0, 2.0, np.zeros(0)), 4.0)
    (1.0, 0.625)
    """
    v = law.freedom
    return (v + 1.0) / (v + (e / law.sd) ** 2) if v < math.inf and law.sd > 0.0 else 1.0


def applied(e: Array, law: Law, features: Array) -> Weights:
    """Weigh innovations (n,) by a law as it is, with features (k, n) of the scale."""
    size = _size(law, features, len(e))
    if not math.isfinite(law.freedom):
        return Weights(law, size, np.ones(len(e)))
    return Weights(law, size, (law.freedom + 1.0) / (law.freedom + (e / (law.sd * size)) ** 2))


def _size(law: Law, features: Array, n: int) -> Array:
    return np.asarray(np.exp(_log_size(law.slopes, features))) if len(law.slopes) else np.ones(n)


# an innovation beyond three sd does not show a larger scale: it may be one outlier
MAX_SQUARE = 9.0


def _log_size(slopes: Array, F: Array) -> Array:
    return _within(slopes @ F, MAX_LOG_SCALE)


def _within(x: Array, most: float) -> Array:
    # not np.clip, which takes three times as long
    out: Array = np.minimum(np.maximum(x, -most), most)
    return out


def _best(x: Array, log_size: Array, share: float, near: float) -> tuple[float, float, float]:
    """Degrees of freedom, scale and log likelihood at given sizes; the Gaussian unless heavier tails add enough.

    `near`: degrees of freedom from which to climb; there is one maximum.
    """
    square = (x * np.exp(-log_size)) ** 2
    shift = float(log_size.sum())
    known: dict[int, tuple[float, float]] = {}

    def value(i: int) -> float:
        if i not in known:
            known[i] = _at(square, FREEDOMS[i], share, shift)
        return known[i][1]

    i = FREEDOMS.index(near)
    while i + 1 < len(FREEDOMS) and value(i + 1) > value(i):
        i += 1
    while i > 0 and value(i - 1) >= value(i):
        i -= 1
    if i and value(i) < value(0) + TAIL_LEAST:
        i = 0
    value(i)
    return FREEDOMS[i], *known[i]


def _at(square: Array, freedom: float, share: float, shift: float) -> tuple[float, float]:
    """Scale and log likelihood at given degrees of freedom."""
    n = len(square)
    scale = max(float(square.mean()), 1e-300)
    if not math.isfinite(freedom):
        return math.sqrt(scale), share * (-0.5 * n * (math.log(2.0 * math.pi * scale) + 1.0) - shift)
    scale *= 1.0 - 2.0 / freedom if freedom > 2.5 else 0.3
    # the scale's fixed point, the mean of the weighted squares
    for _ in range(2):
        scale = max(float((square / (freedom + square / scale)).sum()) * (freedom + 1.0) / n, 1e-300)
    logs = float(np.log1p(square / (freedom * scale)).sum())
    value = n * (_constant(freedom) - 0.5 * math.log(scale)) - 0.5 * (freedom + 1.0) * logs - shift
    return math.sqrt(scale), share * value


@cache
def _constant(freedom: float) -> float:
    return float(
        math.lgamma(0.5 * (freedom + 1.0)) - math.lgamma(0.5 * freedom) - 0.5 * math.log(freedom * math.pi)
    )
