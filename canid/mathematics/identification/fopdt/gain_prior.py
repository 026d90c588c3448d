"""Normal prior of the gains, mixed over typical and atypical drivers, multiplied into the likelihood in closed form.

At one pair of cells the likelihood of the gains is normal, N(K; K', S); with a normal prior N(m, P) the posterior is normal
again, and the marginal likelihood is that of K' in N(m, S + P) (Lindley & Smith 1972). Each stated gain has two
components, P and `ATYPICAL_FACTOR` as wide (the contaminated normal of Tukey 1960), so a driver far from the population is
recognised by the evidence of the data, and then left to them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from canid.values.types import Array

# share of drivers whom a population does not describe, and how much wider the spread is that is taken for them: those of
# Tukey's contaminated normal
ATYPICAL_SHARE = 0.1
ATYPICAL_FACTOR = 3.0


class Normal(NamedTuple):
    """What is stated of one gain; NaN: nothing."""

    mean: float  # output unit per input unit
    sd: float


class GainPrior(NamedTuple):
    """k normal components over m gains; a gain of which nothing is stated has precision 0."""

    mean: tuple[float, ...]  # (m,)
    precision: Array  # (k, m, m)
    log_weight: Array  # (k,) of the component, with half the log determinant of the stated gains' precision

    @property
    def stated(self) -> tuple[bool, ...]:
        """(m,) whether something is stated of a gain."""
        return tuple(bool(p > 0.0) for p in np.diag(self.precision[0]))


class Components(NamedTuple):
    """Posterior of the gains at each pair of cells, by component; `...` stands for the shape of the pairs."""

    log: Array  # (...) log of the marginal likelihood over that at the least-squares gains
    profile: Array  # (k, ...) log of likelihood and prior at the mode, likewise
    share: Array  # (k, ...) of each component, sums to one over them
    mean: tuple[Array, ...]  # m of (k, ...)
    variance: tuple[Array, ...]  # m of (k, ...)
    covariance: Array  # (k, ...) of both gains; zeros of one


def make(stated: Sequence[Normal], correlation: float, atypical: float) -> GainPrior | None:
    """Make the prior; None where nothing is stated.

    Args:
        stated: of each input, in the order of the inputs.
        correlation: of the two gains among drivers.
        atypical: share of drivers whose spread is `ATYPICAL_FACTOR` as large, gain by gain.

    >>> prior = make([Normal(5.0, 1.0), Normal(math.nan, math.nan)], 0.0, 0.1)
    >>> prior.stated, prior.precision[:, 0, 0].round(3).tolist()
    ((True, False), [1.0, 0.111])
    """
    known = [i for i, normal in enumerate(stated) if normal.sd > 0.0]
    if not known:
        return None
    kinds = ((1.0, 1.0 - atypical), (ATYPICAL_FACTOR, atypical)) if atypical > 0.0 else ((1.0, 1.0),)
    precision, log_weight = [], []
    for each in product(kinds, repeat=len(known)):
        sd = np.array([stated[i].sd * factor for i, (factor, _) in zip(known, each, strict=True)])
        covariance = np.outer(sd, sd)
        if len(known) == 2:
            covariance[0, 1] *= correlation
            covariance[1, 0] *= correlation
        inverse = np.zeros((len(stated), len(stated)))
        inverse[np.ix_(known, known)] = np.linalg.inv(covariance)
        precision.append(inverse)
        weight = math.prod(share for _, share in each)
        log_weight.append(math.log(weight) - 0.5 * float(np.linalg.slogdet(covariance)[1]))
    mean = tuple(normal.mean if normal.sd > 0.0 else 0.0 for normal in stated)
    return GainPrior(mean, np.array(precision), np.array(log_weight))


def multiply(
    prior: GainPrior,
    alone: Sequence[Array],
    size: Sequence[Array],
    shared: Array,
    free: Array,
    variance: Array,
) -> Components:
    """Multiply the prior into the likelihood of the gains at every pair of cells.

    A gain of which nothing is stated stays uniform in K |X| over the noise's sd.

    Args:
        prior: of m gains.
        alone: m of (...), the answers' inner products with the output, for answers of one size.
        size: m, of the answers.
        shared: (...) cosine between the two answers.
        free: (...) 1 - shared², bounded away from zero.
        variance: (...) of the noise.

    >>> one, unit = np.ones(1), np.ones(1)
    >>> made = multiply(make([Normal(0.0, 1.0)], 0.0, 0.0), [2.0 * one], [unit], 0.0 * one, unit, unit)
    >>> made.mean[0].tolist(), made.variance[0].tolist()  # two pieces of equal precision
    ([[1.0]], [[0.5]])
    """
    information = [s * s / variance for s in size]
    pulled = [a * s / variance for a, s in zip(alone, size, strict=True)]
    component = _one if len(size) == 1 else _two
    between = shared * size[0] * size[-1] / variance
    components = [component(prior.mean, P, information, pulled, between, free) for P in prior.precision]
    profile, marginal = [], []
    for weight, (of_data, determinant, *_) in zip(prior.log_weight, components, strict=True):
        profile.append(weight - 0.5 * of_data)
        marginal.append(profile[-1] - 0.5 * np.log(determinant))
    log = np.array(marginal)
    highest = log.max(axis=0)
    share = np.exp(log - highest)
    total = share.sum(axis=0)
    total_log = highest + np.log(total)
    for x, known in zip(information, prior.stated, strict=True):
        if not known:
            total_log = total_log + 0.5 * np.log(x)
    m = len(size)
    return Components(
        total_log,
        np.array(profile),
        share / total,
        tuple(np.array([f[2][i] for f in components]) for i in range(m)),
        tuple(np.array([f[3][i] for f in components]) for i in range(m)),
        np.array([f[4] for f in components]),
    )


# twice the log that likelihood and prior lose at the mode, the determinant of the posterior's precision, the gains' means
# and variances, and their covariance
_Posterior = tuple[Array, Array, tuple[Array, ...], tuple[Array, ...], Array]


def _one(
    mean: Sequence[float], P: Array, information: list[Array], pulled: list[Array], _: Array, __: Array
) -> _Posterior:
    """One gain."""
    i, p = information[0], float(P[0, 0])
    A = i + p
    moved = (pulled[0] - i * mean[0]) / A
    lost = p * moved * moved * (1.0 + p / i)
    return lost, A, (mean[0] + moved,), (1.0 / A,), np.zeros_like(A)


def _two(
    mean: Sequence[float],
    P: Array,
    information: list[Array],
    pulled: list[Array],
    between: Array,
    free: Array,
) -> _Posterior:
    """Two gains; no difference of large numbers, whatever the data and the prior know."""
    i, j = information
    p, q, r = float(P[0, 0]), float(P[1, 1]), float(P[0, 1])
    of_data = i * j * free
    # each term but the last is positive; the last is less than the geometric mean of two before it
    determinant = of_data + i * q + j * p + (p * q - r * r) - 2.0 * between * r
    h = pulled[0] - i * mean[0] - between * mean[1]
    k = pulled[1] - j * mean[1] - between * mean[0]
    a = ((j + q) * h - (between + r) * k) / determinant
    b = ((i + p) * k - (between + r) * h) / determinant
    # K' - mode is the data's covariance times what the prior pulls with
    u, v = p * a + r * b, r * a + q * b
    lost = u * a + v * b + (j * u * u - 2.0 * between * u * v + i * v * v) / of_data
    variance = ((j + q) / determinant, (i + p) / determinant)
    return lost, determinant, (mean[0] + a, mean[1] + b), variance, -(between + r) / determinant
