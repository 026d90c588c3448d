"""Sequential Monte Carlo test: replicates of the null are drawn until the answer is clear (Besag & Clifford 1991).

The first replicate at or above the observed value answers against a claim; where none of `MOST` is, the claim stands.
Under the null the observed value is one of `MOST` + 1 that are exchangeable, so it is the largest with a chance of at most 1
in `MOST` + 1, whatever their law and also with ties. No exact rule stands by a claim earlier: of n replicates the chance is
1 in n + 1. Under the null 3.5 replicates are made on average, for a claim that is true all `MOST`.

A name is the largest of many effects, so it is held against the largest of all of them on each replicate (Westfall & Young
1993): the chance of any name that is false is that of one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.fitting.search import Named
from canid.values.findings import NullGain
from canid.values.types import Interval

# of the null's distribution that a claim must exceed
LEVEL = 0.95
# replicates at most: the fewest that show it
MOST = round(1 / (1 - LEVEL)) - 1
# replicates that are simulated side by side, one batch after the other: some drivers lose the lead in three of four
BATCHES = (5, 10, 20, 40, 40, 40)


class Answer(Enum):
    """Does the null give the observed value too?"""

    OPEN = auto()
    NULL = auto()  # it does
    BEYOND = auto()  # it does not


def answer(observed: float, null: Sequence[float]) -> Answer:
    """Compare an observed value with replicates of the null.

    Args:
        observed: large values speak against the null.
        null: values of the replicates so far.

    Example:
        >>> answer(0.1, [0.0, 0.2]), answer(0.3, [0.0, 0.2]), answer(0.3, [0.2] * 19)
        (<Answer.NULL: 2>, <Answer.OPEN: 1>, <Answer.BEYOND: 3>)
    """
    if any(value >= observed for value in null):
        return Answer.NULL
    return Answer.BEYOND if len(null) >= MOST else Answer.OPEN


def point(null: Sequence[float]) -> float:
    """Bound that a further replicate exceeds with a chance of 1 − `LEVEL` at most, for any law; NaN: too few.

    Example:
        >>> point([0.1 * k for k in range(19)]), point([0.0, 0.1])
        (1.8, nan)
    """
    rank = math.ceil(round(LEVEL * (len(null) + 1), 9))
    return sorted(null)[rank - 1] if rank <= len(null) else math.nan


# the name that goes, and why
Gone = tuple[Named, str]


class Statistics(NamedTuple):
    """What one replicate gives."""

    margin: float  # of all effects the largest evidence over what it needs
    # relative reduction of the simulation's error variance on held-out data, of all names together; costs their fits.
    # None: not asked for
    gain: Callable[[], float] | None = None


def unpredictive(named: Sequence[Named], scores: Mapping[str, Interval]) -> Gone | None:
    """The name that predicts least, where that is not surely more than nothing.

    Args:
        named: what was found.
        scores: effect id -> gain in one-step log score on held-out data, nats/min.
    """
    weakest = min(named, key=lambda weakest: scores[weakest.effect.id].low)
    score = scores[weakest.effect.id]
    if score.low > 0 or not np.isfinite(score.low):
        return None
    return (
        weakest,
        f"one-step predictions of held-out data gain {score.value:.2g} [{score.low:.2g}, {score.high:.2g}] nats/min",
    )


def within_null(
    tested: Sequence[Named],
    replicates: Iterable[Statistics],
    where: str,
    progress: Callable[[float], None],
) -> tuple[Gone | None, NullGain]:
    """The weakest name, where any effect reaches its margin on a replicate; and the null's gain of the simulation.

    Args:
        tested: names that noise might give.
        replicates: made one by one, until all is clear.
        where: the loop that was simulated, for the sentence.
        progress: is given the fraction that is done.
    """
    weakest = min(tested, key=margin)
    margins, gains = list[float](), list[float]()
    for replicate in replicates:
        margins.append(replicate.margin)
        progress(len(margins) / MOST)
        reached = answer(margin(weakest), margins)
        if reached is Answer.NULL:
            which = "the first replicate" if len(margins) == 1 else f"1 of {len(margins)} replicates"
            why = f"the driver's own noise, in closed loop {where}, gives an effect as much evidence ({which} without it)"
            return (weakest, why), NullGain()
        if replicate.gain is not None:
            gains.append(replicate.gain())
        if reached is Answer.BEYOND:
            break
    return None, null_gain(gains)


def margin(cause: Named) -> float:
    """Evidence over what is needed, in which the effects of a search compete."""
    return cause.evidence - cause.needed


def null_gain(gains: list[float]) -> NullGain:
    """Median and 95 % point of the gains on replicates; NaN: too few."""
    if len(gains) < MOST:
        return NullGain()
    return NullGain(float(np.median(gains)), point(gains), len(gains))
