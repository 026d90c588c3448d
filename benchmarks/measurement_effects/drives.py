"""Drives of the two outside simulators, and what canid quotes of one that is written as a table.

The simulators are in tests/plants/outside_drives.py: tests may import nothing of the benchmarks.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import canid
from canid.analysis.drive.drive_parameters import Identified
from canid.values.types import QUOTED, Interval, Trace
from tests.plants.outside_drives import Drive, Truth, accel_drive, helly_drive, read_table, write_table

__all__ = ["Drive", "Quoted", "Truth", "accel_drive", "helly_drive", "identified", "quoted", "trace"]


class Quoted(NamedTuple):
    """A number that canid quotes with its interval, and the truth."""

    channel: str
    parameter: str  # K, tau, dead_time or tau_plus_dead_time
    interval: Interval
    truth: float

    @property
    def covers(self) -> bool:
        """Whether the truth is in the interval."""
        return self.interval.low <= self.truth <= self.interval.high

    @property
    def gross(self) -> bool:
        """Whether the truth is farther than two half widths outside."""
        width = self.interval.high - self.interval.low
        return not self.interval.low - width <= self.truth <= self.interval.high + width


def trace(drive: Drive) -> Trace:
    """What canid makes of the drive's table."""
    with tempfile.TemporaryDirectory() as folder:
        return read_table(write_table(drive, Path(folder) / "drive.csv"), drive.truth.output)


def identified(drive: Drive) -> Identified:
    """The parameters of the whole drive, from its table."""
    return canid.identify(trace(drive), select_orders=False, sliding=False)


def quoted(result: Identified, truth: Truth) -> list[Quoted]:
    """What may be quoted of a result: identifiable parameters of the headline, each with its truth."""
    return [
        Quoted(name, parameter, getattr(channel, parameter), truth.of(name, parameter))
        for name, channel in result.channels.items()
        for parameter in QUOTED[channel.status]
    ]
