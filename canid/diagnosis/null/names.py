"""Which name does not stand: one that predicts nothing on held-out data, or whose evidence the driver's own noise gives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from canid.diagnosis.fitting.search import Named
from canid.diagnosis.null import sequential
from canid.diagnosis.null.sequential import Answer
from canid.findings import NullGain
from canid.types import Interval

# the name that goes, and why
Gone = tuple[Named, str]


class Statistics(NamedTuple):
    """What one replicate gives."""

    evidence: Mapping[str, float]  # effect id -> 2 Δ log likelihood over the model without it
    gain: float  # relative reduction of the simulation's error variance on held-out data, of all effects together


def unpredictive(named: Sequence[Named], scores: Mapping[str, Interval]) -> Gone | None:
    """The name that predicts least, where that is not surely more than nothing.

    Args:
        named: what was found.
        scores: effect id -> gain in one-step log score on held-out data, nats/min.
    """
    one = min(named, key=lambda one: scores[one.effect.id].low)
    score = scores[one.effect.id]
    if score.low > 0 or not np.isfinite(score.low):
        return None
    return (
        one,
        f"one-step predictions of held-out data gain {score.value:.2g} [{score.low:.2g}, {score.high:.2g}] nats/min",
    )


def within_null(
    tested: Sequence[Named],
    replicates: Iterable[Statistics],
    settled: Callable[[list[float]], bool],
    where: str,
    progress: Callable[[float], None],
) -> tuple[Gone | None, NullGain]:
    """The name whose evidence the replicates reach, if any; and the null's gain of the simulation.

    Args:
        tested: names whose evidence is compared.
        replicates: made one by one, until all is clear.
        settled: is what the gains of the replicates so far are compared with clear?
        where: the loop that was simulated, for the sentence.
        progress: is given the fraction that is done.
    """
    evidence: dict[str, list[float]] = {one.effect.id: [] for one in tested}
    gains: list[float] = []
    for found in replicates:
        for effect, value in found.evidence.items():
            evidence[effect].append(value)
        gains.append(found.gain)
        progress(len(gains) / sequential.MOST)
        answers = [sequential.answer(one.evidence, evidence[one.effect.id]) for one in tested]
        for one, answer in zip(tested, answers, strict=True):
            if answer is Answer.NULL:
                above = sum(value >= one.evidence for value in evidence[one.effect.id])
                return (
                    one,
                    f"the driver's own noise, in closed loop {where}, gives its evidence too "
                    f"({above} of {len(gains)} replicates without it)",
                ), NullGain()
        if Answer.OPEN not in answers and settled(gains):
            break
    return None, null_gain(gains)


def null_gain(gains: list[float]) -> NullGain:
    """Median and 95 % point of the gains on replicates; NaN: too few."""
    if len(gains) < sequential.LEAST:
        return NullGain()
    return NullGain(float(np.median(gains)), sequential.point(gains), len(gains))
