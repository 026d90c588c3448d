"""The table of all signals with their last values. Apart from what makes it: a process that records only passes it on."""

from __future__ import annotations

from typing import NamedTuple


class Row(NamedTuple):
    """A signal."""

    bus: int
    name: str  # "ENGINE_DATA.PedalPosition"
    text: str  # the value in words, or with its unit
    rate: float  # 1/s, of its message; NaN: one frame
    age: float  # s since its last value


class SignalTable(NamedTuple):
    """The signals at a time."""

    t: float  # s, of the newest frame
    rows: list[Row]
    cpu_s: float  # that the table has taken
    failure: str = ""  # why there is none, and no further one
