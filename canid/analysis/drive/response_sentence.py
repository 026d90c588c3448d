"""A driver's response as the sentence that a test engineer would write, from the numbers that may be quoted."""

from __future__ import annotations

import math
from collections.abc import Mapping

from canid.values.text.names import readable
from canid.values.text.numbers import interval, role_unit
from canid.values.types import QUOTED, Channel, Interval

# role of the output -> what the driver does
DOES = {
    "pedal": "presses the pedal",
    "accel": "accelerates",
    "accel_command": "asks for acceleration",
    "steering_angle": "turns the wheel",
}
# input -> what each unit of it is
FOR_EACH = {
    "range_rate": "m/s by which the lead is faster",
    "headway_error": "second of time headway above the wanted one",
    "lateral_offset": "metre of lateral offset",
}


def response(channels: Mapping[str, Channel], output: str) -> str:
    """What may be quoted, one sentence for each input, in the order of the channels; "" where nothing may.

    Args:
        channels: input -> K, τ, θ with their 95 % intervals and status.
        output: role of the driver's output, for what the driver does and its unit; "" is the output itself.

    Example:
        >>> from canid.values.types import Identifiable
        >>> channel = Channel(Interval(-5.6, -6.2, -5.0), status=Identifiable.GAIN_ONLY)
        >>> response({"lateral_offset": channel}, "steering_angle")
        'The driver turns the wheel by 5.6 [5.0, 6.2] ° less for each metre of lateral offset.'
    """
    said = []
    for name, channel in channels.items():
        known = QUOTED[channel.status]
        if "K" in known and math.isfinite(channel.K.value):
            each = FOR_EACH.get(name, readable(name))
            said.append(f"by {_size(channel.K, output)} for each {each}{_later(channel, known)}")
    does = DOES.get(output, f"changes {readable(output) or 'the output'}")
    return f"The driver {does} {', and '.join(said)}." if said else ""


def _size(gain: Interval, output: str) -> str:
    """A gain's size, and its direction in a word."""
    size, direction = gain, "more"
    if gain.high < 0:
        size, direction = Interval(-gain.value, -gain.high, -gain.low), "less"
    return f"{interval(size, role_unit(output) if output else '')} {direction}"


def _later(channel: Channel, known: tuple[str, ...]) -> str:
    if "tau_plus_dead_time" in known:
        return f", {interval(channel.tau_plus_dead_time, 's')} later"
    if "dead_time" in known and "tau" in known:
        return f", after a dead time of {interval(channel.dead_time, 's')} and with a lag of {interval(channel.tau, 's')}"
    return ""
