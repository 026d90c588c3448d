"""Which of several memories to believe: predictive weights with a fixed share, and when the longest is refuted.

Each memory predicts the next output; its weight is the probability that it predicts best, and a small share
moves every sample so that a weight can come back (Herbster & Warmuth 1998, "Tracking the best expert").
Without a change the longest memory is the best by a little at every sample and the shares keep it on top;
after a change a shorter one takes over within seconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

from canid.values.state_constraints import NOT_NEGATIVE

# Probability at the start that the longest memory is the best. Each other one's samples are few, so its
# estimate is noisy: at 0.995 the mixture's standard deviation after a minute is the longest's to 0.5 %.
HOME = 0.995

# Probability per tenth of a second that the longest of the others becomes the best: a change of the driver in half an hour
# or so. For the shorter ones it is less in proportion to their length: the shorter, the noisier the estimate that
# a chance evidence for it would put into the mixture (with equal ones, 1 minute in 800 ended 8 bounds off).
LEAVE = 5e-5

# Probability that the longest becomes the best again, over LEAVE: after a change it has to fill first, which
# takes a minute or more.
RETURN = 2.0

# Natural logarithm of the odds at which the longest memory is refuted. While it is right the odds are a test
# martingale: they exceed this once in e^12 samples at most, four hours at 10 Hz.
REFUTED = 12.0


class Trust(NamedTuple):
    """How far each memory is believed; the last one is the longest."""

    weights: Annotated[tuple[float, ...], NOT_NEGATIVE]  # sum one
    # probability per sample that each of the others becomes the best
    leave: Annotated[tuple[float, ...], NOT_NEGATIVE] = ()
    odds: Annotated[float, NOT_NEGATIVE] = (
        0.0  # log odds of the mixture against the longest memory, at least 0
    )


def begin(forgetting: Sequence[float], stated: float = 1.0) -> Trust:
    """Trust the longest memory.

    Args:
        forgetting: per sample, ascending; all but the last below one.
        stated: samples' distance, in tenths of a second.

    >>> trust = begin((0.98, 0.99, 1.0))
    >>> [round(w, 5) for w in trust.weights], [round(1e5 * p, 2) for p in trust.leave]
    ([0.00167, 0.00333, 0.995], [2.5, 5.0])
    """
    lengths = [1.0 / (1.0 - x) for x in forgetting[:-1]]
    if not lengths:
        return Trust((1.0,))
    total = sum(lengths)
    return Trust(
        (*[(1.0 - HOME) * x / total for x in lengths], HOME),
        tuple([stated * LEAVE * x / lengths[-1] for x in lengths]),
    )


def step(
    trust: Trust,
    errors: Sequence[float],
    spreads: Sequence[float],
    variance: float,
    freedom: float = math.inf,
) -> Trust:
    """Weigh one sample's predictions.

    Args:
        trust: as left by the sample before.
        errors: one prediction error per memory.
        spreads: variance of each error over that of the noise, at least 1.
        variance: of the noise, positive; of Student's t its squared scale.
        freedom: degrees of freedom of Student's t; infinite: the noise is Gaussian.

    >>> step(Trust((0.5, 0.5), (1e-5,)), (0.0, 3.0), (1.0, 1.0), 1.0).weights[0] > 0.98
    True
    """
    if len(trust.weights) == 1:
        return trust
    exp, log = math.exp, math.log
    square = [e * e / (variance * s) for e, s in zip(errors, spreads, strict=True)]
    if freedom < math.inf:
        square = [(freedom + 1.0) * math.log1p(x / freedom) for x in square]
    likelihood = [-0.5 * (x + log(s)) for x, s in zip(square, spreads, strict=True)]
    top = max(likelihood)
    joint = [w * exp(x - top) for w, x in zip(trust.weights, likelihood, strict=True)]
    total = sum(joint)
    home = joint[-1] / total
    back = 1.0 - RETURN * trust.leave[-1]
    away = [back * x / total + p * home for x, p in zip(joint, trust.leave, strict=False)]
    # the sum of the log ratios since they were last below zero (Page 1954)
    odds = max(0.0, trust.odds + log(total) - (likelihood[-1] - top))
    return Trust((*away, 1.0 - sum(away)), trust.leave, odds)


def refuted(trust: Trust) -> int | None:
    """Return the memory to begin anew from, or None while the longest stands.

    >>> refuted(Trust((0.9, 0.1), (1e-5,), 13.0))
    0
    """
    if trust.odds <= REFUTED:
        return None
    return max(range(len(trust.weights) - 1), key=trust.weights.__getitem__)


def renew(trust: Trust) -> Trust:
    """After the longest memory began anew the odds are even; its weight grows back with what it then predicts.

    >>> renew(Trust((0.8, 0.1, 0.1), (1e-5, 1e-5), 13.0)).odds
    0.0
    """
    return trust._replace(odds=0.0)


def shares(trust: Trust) -> tuple[float, ...]:
    """Return the share of each memory in the estimate: its weight squared, normalised.

    An average over all that may be true carries the noise of the shortest memories for a small chance that
    they are right. Squares keep two equals equal and drop the small chances.

    >>> [round(x, 3) for x in shares(Trust((0.1, 0.9)))]
    [0.012, 0.988]
    """
    squares = [w * w for w in trust.weights]
    total = sum(squares)
    return tuple([x / total for x in squares])
