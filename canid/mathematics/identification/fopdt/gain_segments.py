"""Change points of the gains over a whole drive: binary segmentation (Vostrikova 1981) by the statistic of gain_step.py.

A stretch is split at its likeliest second where the sum of the Bayes factors of all its seconds exceeds the threshold; then
each part again. While nothing changes, the sum exceeds A in a drive of N seconds with probability N / A at most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.fopdt import gain_step
from canid.mathematics.identification.fopdt.answer_columns import Columns
from canid.mathematics.identification.fopdt.drifting_level import Level
from canid.values.types import NAN, Array

# s of usable data on both sides of a change point: below, neither gain is known
MIN_SEGMENT_S = 20.0


class ChangePoint(NamedTuple):
    """A step of the gains, in blocks of rows."""

    block: int  # the first block after it
    low: int  # 95 % interval of that
    high: int
    evidence: float  # log of the sum of the Bayes factors


def segment(
    parts: Array, used: Array, columns: Columns, size: Array, threshold: float, level: Level | None = None
) -> list[ChangePoint]:
    """Find all change points, in their order.

    Args:
        parts: (b, c, c) inner products of the blocks, `gain_step.grams`.
        used: (b,) s of usable data in each.
        columns: names the columns.
        size: (m,) of the gains.
        threshold: log of the sum of Bayes factors that is a change.
        level: of the same blocks, an offset that may drift; None: it stays between the changes.
    """
    out: list[ChangePoint] = []
    open_stretches = [(0, len(parts))]
    while open_stretches:
        first, stop = open_stretches.pop()
        level_here = level and Level(
            level.with_columns[first:stop], level.with_each_other[first:stop], level.variance
        )
        split = _split(parts[first:stop], used[first:stop], columns, size, level_here)
        if split is None or split.evidence < threshold:
            continue
        moved = ChangePoint(split.block + first, split.low + first, split.high + first, split.evidence)
        out.append(moved)
        open_stretches += [(first, moved.block), (moved.block, stop)]
    return sorted(out)


# factors of both gains that are tried for the smallest one that would be seen
FACTORS = np.arange(1.1, 4.05, 0.1)
# standard normal: power of 90 %
POWER_SIGMAS = 1.28


def visible_factor(
    parts: Array,
    used: Array,
    columns: Columns,
    gains: Array,
    size: Array,
    threshold: float,
    seconds: float,
    level: Level | None = None,
) -> float:
    """Least factor of all gains at once that would be found nine times out of ten, so long after it; NaN: none would.

    What the drive shows of its gains is taken as coming evenly.

    Args:
        parts, used, columns, size, threshold, level: as in `segment`.
        gains: (m,) of the driver.
        seconds: of usable data since the change; before it is the rest of the drive.
    """
    m, whole = columns.inputs, float(used.sum())
    if whole - seconds < MIN_SEGMENT_S or seconds < MIN_SEGMENT_S:
        return NAN
    known = gain_step.covariance(parts, columns, level)[:m, :m]
    C = known * (whole / seconds + whole / (whole - seconds))
    prior = gain_step.change_prior(size)
    after = np.linalg.inv(np.linalg.inv(C) + np.linalg.inv(prior))
    less = 0.5 * float(np.linalg.slogdet(after)[1] - np.linalg.slogdet(prior)[1])
    way = np.linalg.solve(C, gains)
    # twice the log likelihood ratio of a change by the gains themselves
    unit = float(way @ after @ way)
    for factor in FACTORS.tolist():
        ratio = (factor - 1.0) ** 2 * unit
        if less + 0.5 * ratio - POWER_SIGMAS * ratio**0.5 >= threshold:
            return round(float(factor), 1)
    return NAN


def _split(
    parts: Array, used: Array, columns: Columns, size: Array, level: Level | None
) -> ChangePoint | None:
    """Return the likeliest change point of one stretch."""
    if used.sum() < 2.0 * MIN_SEGMENT_S:
        return None
    steps = gain_step.of_grams(parts, columns, size, np.arange(len(parts), dtype=float), level=level)
    before = np.cumsum(used)[:-1]
    enough = (before >= MIN_SEGMENT_S) & (used.sum() - before >= MIN_SEGMENT_S)
    # where nothing is measured, nothing can be dated: a pause counts once, at its end
    enough &= used[1:] > 0.0
    if not enough.any():
        return None
    chosen = gain_step.Steps(*(x[enough] for x in steps))
    row, low, high = gain_step.when(chosen)
    return ChangePoint(int(row), int(low), int(high), chosen.evidence)
