"""Dead times from what the radar saw, not from its report: a stated latency is added, with its uncertainty.

A report that comes late shows the lead as it was: the driver, who sees the lead itself, seems to respond earlier by the
latency, one to one. No log of a driver shows it; who knows the radar states it in `[lead] latency`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import TASK_INPUTS, Channel, Interval, Latency

# inputs that the radar measures
OF_RADAR = TASK_INPUTS["car_following"]


def later(delay: Interval, latency: Latency) -> Interval:
    """Return a delay from what the radar saw.

    >>> later(Interval(0.3, 0.2, 0.4), Latency(0.1, 0.0))
    Interval(value=0.4, low=0.3, high=0.5)
    """
    by = NORMAL_QUANTILE * latency.sd
    value = delay.value + latency.value
    low, high = math.hypot(delay.value - delay.low, by), math.hypot(delay.high - delay.value, by)
    return Interval(*(round(x, 9) for x in (value, value - low, value + high)))


def channels(seen: Mapping[str, Channel], latency: Latency) -> dict[str, Channel]:
    """Return channels with the dead times of the radar's inputs from what it saw."""
    return {
        name: channel._replace(
            dead_time=later(channel.dead_time, latency),
            tau_plus_dead_time=later(channel.tau_plus_dead_time, latency),
        )
        if name in OF_RADAR
        else channel
        for name, channel in seen.items()
    }
