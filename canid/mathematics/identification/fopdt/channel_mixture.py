"""Channels of several models as one: mean and 95 % interval of the mixture of their posteriors."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt.weighted_quantiles import quantiles
from canid.mathematics.identification.identifiability import PARAMETERS
from canid.values.types import Array, Channel, Identifiable, Interval

# from what may be quoted least to most
ORDER = (Identifiable.NOT, Identifiable.GAIN_ONLY, Identifiable.SUM_ONLY, Identifiable.OK)
# quantile points that stand for a Gaussian: so many give its 95 % interval to half a percent
POINTS = np.array([NormalDist().inv_cdf((i + 0.5) / 199) for i in range(199)])


def mixed(channels: Sequence[tuple[Channel, ...]], shares: Array) -> tuple[Channel, ...]:
    """Mean, and quantiles of the mixture of what the models' intervals say; quotable is what all may quote.

    An interval stands for two halves of Gaussians that meet at its value.

    Args:
        found: of each model, its channels; the progress of one model is none of the mixture.
        shares: (k,) of the models, summing to one.

    >>> one = Channel(K=Interval(1.0, 0.0, 2.0), status=Identifiable.OK)
    >>> mixed([(one,)], np.ones(1))[0] == one
    True
    >>> two = one._replace(K=Interval(3.0, 2.0, 4.0), status=Identifiable.GAIN_ONLY)
    >>> made = mixed([(one,), (two,)], np.array([0.5, 0.5]))[0]
    >>> [round(x, 1) for x in made.K], made.status.value
    ([2.0, 0.2, 3.8], 'gain_only')
    """
    if len(channels) == 1:
        return channels[0]
    out = []
    for parts in zip(*channels, strict=True):
        fields = {}
        for name in PARAMETERS:
            fields[name] = _mixture(np.array([getattr(part, name) for part in parts]), shares)
        least = min((part.status for part in parts), key=ORDER.index)
        out.append(parts[0]._replace(**fields, status=least, progress=None))
    return tuple(out)


def _mixture(intervals: Array, shares: Array) -> Interval:
    """Mean and 95 % interval of intervals (k, 3)."""
    if not np.isfinite(intervals).all():
        return Interval()
    value, low, high = intervals.T
    sides = np.where(POINTS < 0.0, (value - low)[:, None], (high - value)[:, None]) / NORMAL_QUANTILE
    points = value[:, None] + sides * POINTS
    read = quantiles(points.ravel(), np.repeat(shares, len(POINTS)))
    mean = float(shares @ value)
    return Interval(mean, min(read.low, mean), max(read.high, mean))


def with_progress(mixture: Sequence[Channel], likeliest: Sequence[Channel]) -> list[Channel]:
    """Channels of a mixture with what the likeliest model still lacks, where both have the same status."""
    return [
        channel._replace(progress=likely.progress) if channel.status is likely.status else channel
        for channel, likely in zip(mixture, likeliest, strict=True)
    ]
