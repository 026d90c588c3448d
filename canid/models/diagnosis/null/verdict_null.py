"""Does a drive without an unknown structure fail the adequacy tests as well? The same tests on replicates.

The bounds of the tests assume innovations that are Gaussian once they are whitened and scaled. Those of people have heavy
tails and come in bursts; what such noise gives in the loop behind this lead is no structure of the inputs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from canid.models.diagnosis.adequacy import adequacy
from canid.models.diagnosis.adequacy.adequacy import Adequacy, Family
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.null import bootstrap, replicates, sequential
from canid.models.diagnosis.null.noise_source import Source
from canid.models.diagnosis.null.replicates import Drive
from canid.models.diagnosis.null.sequential import Answer

# least probability that a logarithm is taken of
LEAST_P = 1e-300


class Judged(NamedTuple):
    """The tests as they stand after the comparison."""

    held: Adequacy
    step: str  # what was compared; "": nothing was


def judge(
    drive: Drive,
    search: Search,
    held: Adequacy,
    noise: Source,
    explained: float,
    seed: int,
    progress: Callable[[float], None],
) -> Judged:
    """Withdraw the failures that the null gives too.

    Args:
        drive: the recorded one.
        search: what the search ended with; its last model is the null.
        held: the tests on the recorded drive.
        noise: of the last model's driver.
        explained: as in `adequacy.assess`.
        seed: of the draws.
        progress: is given the fraction that is done.
    """
    if held.passed or search.holds or search.random_walk is not None:
        return Judged(held, "")
    observed = max(map(_size, held.failed))
    null: list[float] = []
    answer = Answer.OPEN
    for batch, count in enumerate(sequential.BATCHES):
        for replicate in replicates.simulated(drive, search.solved, noise, count, [seed, 1, batch]):
            size = _failure(replicate, search, explained)
            if size is not None:
                null.append(size)
            progress(len(null) / sequential.MOST)
            answer = sequential.answer(observed, null)
            if answer is not Answer.OPEN:
                break
        if answer is not Answer.OPEN:
            break
    # a driver who does not follow in closed loop has no null
    if answer is Answer.OPEN:
        return Judged(held, "")
    if answer is Answer.NULL:
        says = f"residual not adequate, but no more than with the driver's own noise in the loop ({len(null)} replicates)"
        return Judged(held._replace(passed=True, failed=(), share=0.0), says)
    bound = sequential.point(null)
    failed = tuple(family for family in held.failed if _size(family) > bound)
    says = f"residual not adequate, beyond the driver's own noise in the loop ({len(null)} replicates)"
    return Judged(held._replace(failed=failed, share=max(f.share for f in failed)), says)


def _size(family: Family) -> float:
    return -math.log(max(family.p, LEAST_P))


def _failure(replicate: replicates.Replicate, search: Search, explained: float) -> float | None:
    """Smallest chance of a material family on a replicate, as −log; None: it cannot be fitted."""
    made = bootstrap.refitted(replicate, search.solved)
    if made is None:
        return None
    data, solved = made
    tested = adequacy.assess(Search(solved, data, solved, search.named), data, explained)
    return max((_size(f) for f in tested.families if f.share >= tested.material), default=0.0)
