"""Numbers, intervals and channels as the columns of a row: plain Python values, None where nothing is known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from canid.analysis.fleet.storage.columns import CHANNELS, PARAMETERS
from canid.values.text.json_values import number
from canid.values.types import Channel, Interval

Row = dict[str, Any]


def interval_columns(name: str, interval: Interval) -> Row:
    """An interval as its three columns.

    Example:
        >>> interval_columns("K", Interval(1.0, float("nan"), 2.0))
        {'K': 1.0, 'K_low': None, 'K_high': 2.0}
    """
    ends = zip(("", "_low", "_high"), interval, strict=True)
    return {f"{name}{end}": number(x) for end, x in ends}


def channel_columns(channels: Mapping[str, Channel]) -> Row:
    """The columns of every input that a fleet knows; of one that the drive does not have they are None.

    Example:
        >>> row = channel_columns({"range_rate": Channel(K=Interval(5.0, 4.0, 6.0))})
        >>> row["range_rate_K_low"], row["range_rate_status"], row["lateral_offset_status"]
        (4.0, 'not_identifiable', None)
    """
    row: Row = {}
    for name in CHANNELS:
        channel = channels.get(name)
        row[f"{name}_status"] = None if channel is None else channel.status.value
        for parameter, _ in PARAMETERS:
            row |= interval_columns(
                f"{name}_{parameter}", Interval() if channel is None else getattr(channel, parameter)
            )
    return row
