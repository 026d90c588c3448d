"""The bias of the gain of an input that the loop holds, the headway error, and its removal.

A lasting push of the driver's own noise is answered by the loop: the headway moves until K times its error makes up for
the push. So the mean of the headway error over a drive holds the noise that came before its end, and a regression with an
offset, which takes that mean away, correlates each row with the noise of all rows. With noise of any spectrum the whitened
headway answers a whitened shock with -1/K in the long run, hence to first order E(estimate) - K = var(estimate) / K: a gain
that is known to 40 % comes out 16 % too large. It is the bias of predictive regressions (Kendall 1954; Stambaugh 1999).
A drift of the offset (fopdt/offset_drift.py) is a part of the noise, with no free mean of its own, and adds nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.identifiability import with_gain
from canid.values.types import Channel, Interval

# the inputs that a driver's loop holds
HELD = ("headway_error", "lateral_offset")


def held(names: Sequence[str]) -> int | None:
    """Which input the loop holds.

    >>> held(("headway_error", "range_rate")), held(("x",))
    (0, None)
    """
    return next((i for i, name in enumerate(names) if name in HELD), None)


def without_all(channels: Mapping[str, Channel]) -> dict[str, Channel]:
    """The channels of a model, those of inputs that the loop holds without their bias."""
    return {name: without(channel) if name in HELD else channel for name, channel in channels.items()}


def without(channel: Channel) -> Channel:
    """Move the interval of K by the bias; half a standard deviation at most.

    Args:
        channel: of the input that the loop holds.

    >>> channel = Channel(K=Interval(5.0, 1.08, 8.92))  # known to 2.0
    >>> [round(x, 2) for x in without(channel).K]
    [4.31, 0.39, 8.23]
    >>> exact = Channel(K=Interval(5.0, 4.9, 5.1))
    >>> round(without(exact).K.value, 3)
    4.999
    """
    K = channel.K
    variance = ((K.high - K.low) / (2.0 * NORMAL_QUANTILE)) ** 2
    if not (math.isfinite(variance) and math.isfinite(K.value) and variance > 0.0):
        return channel
    by = variance * K.value / (K.value * K.value + variance)
    moved = Interval(K.value - by, K.low - by, K.high - by)
    # what may be quoted was judged before; a gain that may be zero now may not
    return with_gain(channel, moved) if K.low * K.high > 0.0 else channel._replace(K=moved)
