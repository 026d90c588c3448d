"""Change points of the gains over a whole drive: binary segmentation (Vostrikova 1981) by the statistic of gain_step.py.

A stretch is split at its likeliest second where the sum of the Bayes factors of all its seconds exceeds the threshold; then
each part again. While nothing changes, the sum exceeds A in a drive of N seconds with probability N / A at most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.identification.fopdt import gain_step
from canid.identification.fopdt.answer_columns import Columns
from canid.types import Array

# s of usable data on both sides of a change point: below, neither gain is known
MIN_SEGMENT_S = 20.0


class ChangePoint(NamedTuple):
    """A step of the gains, in blocks of rows."""

    block: int  # the first block after it
    low: int  # 95 % interval of that
    high: int
    evidence: float  # log of the sum of the Bayes factors


def segment(parts: Array, used: Array, columns: Columns, size: Array, threshold: float) -> list[ChangePoint]:
    """Find all change points, in their order.

    Args:
        parts: (b, c, c) inner products of the blocks, `gain_step.grams`.
        used: (b,) s of usable data in each.
        columns: names the columns.
        size: (m,) of the gains.
        threshold: log of the sum of Bayes factors that is a change.
    """
    out: list[ChangePoint] = []
    open_stretches = [(0, len(parts))]
    while open_stretches:
        first, stop = open_stretches.pop()
        found = _split(parts[first:stop], used[first:stop], columns, size)
        if found is None or found.evidence < threshold:
            continue
        moved = ChangePoint(found.block + first, found.low + first, found.high + first, found.evidence)
        out.append(moved)
        open_stretches += [(first, moved.block), (moved.block, stop)]
    return sorted(out)


def _split(parts: Array, used: Array, columns: Columns, size: Array) -> ChangePoint | None:
    """Return the likeliest change point of one stretch."""
    if used.sum() < 2.0 * MIN_SEGMENT_S:
        return None
    found = gain_step.of_grams(parts, columns, size, np.arange(len(parts), dtype=float))
    before = np.cumsum(used)[:-1]
    enough = (before >= MIN_SEGMENT_S) & (used.sum() - before >= MIN_SEGMENT_S)
    # where nothing is measured, nothing can be dated: a pause counts once, at its end
    enough &= used[1:] > 0.0
    if not enough.any():
        return None
    chosen = gain_step.Steps(*(x[enough] for x in found))
    row, low, high = gain_step.when(chosen)
    return ChangePoint(int(row), int(low), int(high), chosen.evidence)
