"""Does a drive without an unknown structure fail the adequacy tests as well? The same tests on replicates.

The bounds of the tests assume innovations that are Gaussian once they are whitened and scaled. Those of people have heavy
tails and come in bursts; what such noise gives in the loop behind this lead is no structure of the inputs. Each family
counts in units of its own mean on drive and replicates: one whose chance is wrong would set the bound of all others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
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

# replicates from which on the families' means are compared, and drives with a mean of 1 that each is averaged with
MIN_REPLICATES, PRIOR_DRIVES = 5, 10
# name of a family -> minus the logarithm of its p
Sizes = Mapping[str, float]


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
    observed, null = _sizes(held), list[Sizes]()
    others, answer = list[float](), Answer.OPEN
    for batch, count in enumerate(sequential.BATCHES):
        for replicate in replicates.simulated(drive, search.solved, noise, count, [seed, 1, batch]):
            sizes = _replicated(replicate, search, explained)
            if sizes is not None:
                null.append(sizes)
            progress(len(null) / sequential.MOST)
            if len(null) < MIN_REPLICATES:
                continue
            first, *others = largest([observed, *null])
            answer = sequential.answer(first, others)
            if answer is not Answer.OPEN:
                break
        if answer is not Answer.OPEN:
            break
    # a driver who does not follow in closed loop has no null
    if answer is Answer.OPEN:
        return Judged(held, "")
    bound, means = sequential.point(others), _means([observed, *null])
    # of a family that does not fail by itself nothing is said
    failed = tuple(family for family in held.failed if _size(family) / means[family.name] > bound)
    if answer is Answer.NULL or not failed:
        says = f"residual not adequate, but no more than with the driver's own noise in the loop ({len(null)} replicates)"
        return Judged(held._replace(passed=True, failed=(), share=0.0), says)
    says = f"residual not adequate, beyond the driver's own noise in the loop ({len(null)} replicates)"
    return Judged(held._replace(failed=failed, share=max(f.share for f in failed)), says)


def largest(every: Sequence[Sizes]) -> list[float]:
    """Largest size on each drive, each family's in units of its mean over all of them.

    The units are the same whichever of the drives is the recorded one, so that its rank is exact (Westfall & Young 1993).

    Example:
        >>> [round(x, 1) for x in largest([{"a": 9.0}, {"a": 0.5, "b": 30.0}, {"b": 40.0}])]
        [6.0, 4.9, 6.5]
    """
    means = _means(every)
    return [max((size / means[name] for name, size in sizes.items()), default=0.0) for sizes in every]


def _means(every: Sequence[Sizes]) -> Sizes:
    """Mean size of each family, with as many drives of a right chance, 1, as are known beforehand."""
    names = {name for sizes in every for name in sizes}
    known = len(every) + PRIOR_DRIVES
    total = {name: sum(sizes.get(name, 0.0) for sizes in every) for name in names}
    return {name: max((total[name] + PRIOR_DRIVES) / known, 1.0) for name in names}


def _size(family: Family) -> float:
    return -math.log(max(family.p, LEAST_P))


def _sizes(tested: Adequacy) -> Sizes:
    """Sizes of the material families."""
    return {family.name: _size(family) for family in tested.families if family.share >= tested.material}


def _replicated(replicate: replicates.Replicate, search: Search, explained: float) -> Sizes | None:
    """Sizes on a replicate; None: it cannot be fitted."""
    made = bootstrap.refitted(replicate, search.solved)
    if made is None:
        return None
    data, solved = made
    made_search = Search(solved, data, solved, search.named)
    return _sizes(adequacy.assess(made_search, data, explained, material_alone=True))
