"""Gain of the extended simulation of lane keeping on held-out data, open loop, as in car following."""

from __future__ import annotations

import numpy as np

from canid.diagnosis.driver import held_out
from canid.diagnosis.lane.lane_data import LaneData
from canid.diagnosis.lane.lane_fit import FittedLane
from canid.types import Array, Interval

Episodes = tuple[tuple[int, int], ...]  # [start, stop) samples


def held(model: Array, episodes: Episodes) -> Array:
    """The simulated angle (n,), held where the wheel is.

    Example:
        >>> held(np.array([0.0, 1.0, 2.0, 3.0]), ((1, 3),))
        array([0., 1., 1., 3.])
    """
    out = model.copy()
    for start, stop in episodes:
        out[start:stop] = out[start]
    return out


def gain(
    data: LaneData, base: FittedLane, masked: LaneData, extended: FittedLane, episodes: Episodes = ()
) -> Interval:
    """Relative reduction of the error's variance, each fold simulated by the models as fitted to the others.

    Args:
        data: the drive.
        base: the baseline, fitted to it.
        masked: the drive without the episodes.
        extended: the model with its causes, fitted to that.
        episodes: in which the wheel is held.
    """
    fold, y = held_out.dealt(data), data.output.y
    before, after = np.zeros(y.size), np.zeros(y.size)
    for k in range(held_out.FOLDS):
        here, train = fold == k, fold != k
        without = held_out.refitted(data, base, train).fitted.model
        model = held(held_out.refitted(masked, extended, train).fitted.model, episodes)
        before[here], after[here] = ((y - without) ** 2)[here], ((y - model) ** 2)[here]
    return held_out.gain(before, after, data.output.usable, data.output.dt)
