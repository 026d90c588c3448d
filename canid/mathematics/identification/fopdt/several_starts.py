"""The search of a whole drive from several starts: the likeliest answer, and those that the data cannot tell from it.

Gains and noise model are fitted in turn, so that some drives have two pairs that reproduce themselves: small gains with a
noise that takes what they leave, and others with another noise. The starts are the whole box, where that search ended,
that with half as much gain again of the input that the loop holds, and where each half of the rows ends; likelihoods choose
among the ends. In a loop a small gain takes a slow noise for the driver's answer, and what it leaves shows none of it: an
offset that drifts is found from a larger gain only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from canid.mathematics.identification import band
from canid.mathematics.identification.fopdt import channel_mixture, grid_search, reduced_basis
from canid.mathematics.identification.fopdt.grid_search import Optimum, ProcessFit, Start, Task, enough, ready
from canid.mathematics.identification.fopdt.row_noise import by_channel
from canid.mathematics.identification.identifiability import PARAMETERS, apart, not_quotable
from canid.values.types import Channel

# Noise models that are refitted from each start: a start's own fit was to other rows.
LEAST_REFITS = 2
# Of the gain that the loop holds, in a further start.
RAISED = 1.5
# Half-widths of the intervals by which two ends may differ to be one answer.
SAME_HALF_WIDTHS = 0.25
# Share of the posterior below which an answer changes no interval.
MIN_SHARE = 0.05


def search(task: Task, held: int | None = None) -> ProcessFit:
    """Fit from every start; the likeliest answer, its intervals widened by those of the others that are within reach.

    Args:
        task: a whole drive.
        held: the input that the loop holds; None: none.
    """
    task = task._replace(scored=True)
    first = grid_search.search(task)
    # fits of one stride may be compared
    same = task._replace(limits=band.Strides(first.stride, first.stride))
    raised = None if held is None else _raised(task, first.start, held)
    starts = [first.start, raised, *(_start_of_part(task, half) for half in _halves(task))]
    every = [grid_search.search(same, start, least=LEAST_REFITS) for start in starts if start is not None]
    scored = [fit for fit in (first, *every) if fit.posterior is not None and math.isfinite(fit.score)]
    if not scored:
        return first
    distinct = _distinct(sorted(scored, key=lambda fit: fit.score, reverse=True))
    best = distinct[0]
    # the likelihood of residuals that are not white says less, as in the posterior
    weight = np.exp([(fit.score - best.score) / best.variance_inflation for fit in distinct])
    kept = weight / weight.sum() > MIN_SHARE
    shares = weight[kept] / weight[kept].sum()
    near = [fit for fit, keep in zip(distinct, kept, strict=True) if keep]
    mixture = channel_mixture.mixed([fit.channels for fit in near], shares)
    known = channel_mixture.with_progress(mixture, best.channels)
    channels = [
        not_quotable(channel) if apart([fit.channels[i].K for fit in near]) else known[i]
        for i, channel in enumerate(mixture)
    ]
    optima = tuple(Optimum(fit.channels, float(share)) for fit, share in zip(near, shares, strict=True))
    return best._replace(channels=tuple(channels), optima=optima)


def _raised(task: Task, start: Start | None, held: int) -> Start | None:
    """Return where a search ended, with more gain of one input."""
    if start is None:
        return None
    layout, point = task.layout, start.point
    nodes = by_channel(layout, reduced_basis.weights(layout.basis, point.tau, point.dead_time))
    more = (RAISED - 1.0) * point.K * (np.arange(layout.inputs) == held)
    return start._replace(point=point._replace(K=point.K + more, w=point.w + more @ nodes))


def _halves(task: Task) -> tuple[slice, slice]:
    """Rows with the first and the last half of those that are usable."""
    middle = int(np.searchsorted(np.cumsum(task.data.usable), task.used // 2))
    return slice(0, middle), slice(middle, None)


def _start_of_part(task: Task, part: slice) -> Start | None:
    """Where the search on some of the rows ends; None: they are too few."""
    data = task.data
    both, usable, bounded = data.both[:, part].copy(), data.usable[part], data.bounded[part]
    if not enough(both, usable, task.layout.inputs):
        return None
    count = int(usable.sum())
    half = ready(both, usable, bounded, data.side[part], count)
    return grid_search.search(task._replace(data=half, used=count, slow=None)).start


def _distinct(scored: Sequence[ProcessFit]) -> list[ProcessFit]:
    """Leave out what is nearly the same as one before."""
    out: list[ProcessFit] = []
    for fit in scored:
        if not any(_same(fit.channels, other.channels) for other in out):
            out.append(fit)
    return out


def _same(channels: Sequence[Channel], other: Sequence[Channel]) -> bool:
    for a, b in zip(channels, other, strict=True):
        for name in PARAMETERS:
            x, y = getattr(a, name), getattr(b, name)
            if abs(x.value - y.value) > SAME_HALF_WIDTHS * 0.5 * (y.high - y.low):
                return False
    return True
