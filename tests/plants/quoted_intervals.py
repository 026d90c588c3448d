"""What canid quotes of a drive whose truth is known, and what becomes of it when the measurement changes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.analysis.drive import drive_parameters
from canid.analysis.drive.drive_parameters import Identified
from canid.values.errors import CanidError
from canid.values.findings import Fit
from canid.values.types import QUOTED, Interval, Trace
from tests.plants import lane_tables
from tests.plants.outside_drives import SIMULATORS, Drive, Truth, drawn_drive, read_table, write_table
from tests.plants.sensor_effects import Drawn, applied, drawn_effects


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

    def __str__(self) -> str:
        return f"{self.channel} {self.parameter} {self.interval} instead of {self.truth:.3g}"


def trace(drive: Drive) -> Trace:
    """What canid makes of the drive's table."""
    with tempfile.TemporaryDirectory() as folder:
        return read_table(write_table(drive, Path(folder) / "drive.csv"), drive.truth.output)


def identified(drive: Drive) -> Identified | None:
    """What `canid.identify` quotes of the whole drive, from its table; None: canid refuses the table."""
    try:
        return drive_parameters.whole_drive(trace(drive))
    except CanidError:
        return None


def quoted(result: Identified | Fit | None, truth: Truth | lane_tables.Truth) -> tuple[Quoted, ...]:
    """What may be quoted of a result: identifiable parameters of the headline, each with its truth."""
    if result is None:
        return ()
    return tuple(
        Quoted(name, parameter, getattr(channel, parameter), truth.of(name, parameter))
        for name, channel in result.channels.items()
        for parameter in QUOTED[channel.status]
    )


def silent_misses(before: Iterable[Quoted], after: Iterable[Quoted]) -> list[Quoted]:
    """What covered or was not quoted at all before, and is quoted and does not cover after."""
    missed = {(each.channel, each.parameter) for each in before if not each.covers}
    return [each for each in after if not each.covers and (each.channel, each.parameter) not in missed]


class Tried(NamedTuple):
    """A drive before and after a combination of effects."""

    seed: int
    simulator: str
    effects: tuple[Drawn, ...]
    before: tuple[Quoted, ...]
    after: tuple[Quoted, ...]
    findings: tuple[str, ...]  # names, after

    @property
    def misses(self) -> list[Quoted]:
        """Silent ones."""
        return silent_misses(self.before, self.after)


def tried(seed: int, seconds: float = 600.0) -> Tried:
    """Draw a simulator, a driver, a drive and up to three effects by the seed, and identify with and without them."""
    rng = np.random.default_rng([seed, 47])
    simulator = str(rng.choice(sorted(SIMULATORS)))
    effects = drawn_effects(rng)
    return _tried(seed, simulator, effects, drawn_drive(simulator, seed, seconds=seconds), rng)


def tried_lane(seed: int, seconds: float = 600.0) -> Tried:
    """As `tried`, of a drive that keeps the lane."""
    rng = np.random.default_rng([seed, 48])
    effects = drawn_effects(rng, among=lane_tables.EFFECTS)
    return _tried(seed, "lane", effects, lane_tables.lane_drive(seed, seconds), rng)


def _tried(
    seed: int, simulator: str, effects: tuple[Drawn, ...], drive: Drive, rng: np.random.Generator
) -> Tried:
    result = identified(applied(drive, effects, rng))
    names = () if result is None else tuple(dict.fromkeys(each.name for each in result.findings))
    return Tried(
        seed,
        simulator,
        effects,
        quoted(identified(drive), drive.truth),
        quoted(result, drive.truth),
        names,
    )
