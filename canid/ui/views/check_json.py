"""What `canid check --json` writes: a vehicle file against frames, the ids of a log, a vehicle file alone, or interfaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.analysis.drive.vehicle_check import Check, Contents, Row
from canid.signals.signal_checks.output_scale import OutputScale
from canid.values.types import DriveTime, SignalFinding


class CheckedRole(NamedTuple):
    """One role."""

    row: Row
    left_out: Mapping[str, int]  # why a reading has no value -> how often


class Unmapped(NamedTuple):
    """Frames that the vehicle file does not name."""

    bus: int
    id: int
    frames: int


class CheckedVehicle(NamedTuple):
    """A vehicle file against the frames of a log or a bus."""

    frames: int
    duration: float  # s
    roles: Mapping[str, CheckedRole]
    gates: Mapping[str, float]  # share of the time, %
    time: DriveTime
    signals: tuple[SignalFinding, ...]
    problems: tuple[str, ...]
    remarks: tuple[str, ...]
    lead_changes: tuple[float, ...]  # s
    unmapped: tuple[Unmapped, ...]
    output_scale: OutputScale | None = None  # of a pedal
    apart: Mapping[str, int] = {}  # "error", "remote" -> frames, which are in `frames` and in no id
    paused: float = 0.0  # s of `duration` in which no frame came


class Id(NamedTuple):
    """Frames of one id and length."""

    bus: int
    id: int
    bytes: int
    frames: int


class Ids(NamedTuple):
    """What a log contains, without a vehicle file."""

    frames: int
    duration: float  # s
    ids: tuple[Id, ...]
    apart: Mapping[str, int] = {}  # "error", "remote" -> frames, which are in `frames` and in no id
    paused: float = 0.0  # s of `duration` in which no frame came


class VehicleAlone(NamedTuple):
    """A vehicle file without frames."""

    roles: tuple[str, ...]
    output: str


class Interfaces(NamedTuple):
    """Bus interfaces, without a vehicle file, log or bus."""

    interfaces: tuple[str, ...]


CheckJson = CheckedVehicle | Ids | VehicleAlone | Interfaces


def checked(made: Check) -> CheckedVehicle:
    """A check with a vehicle file."""
    return CheckedVehicle(
        made.frames,
        made.duration,
        {row.role: CheckedRole(row, made.left_out.get(row.role, {})) for row in made.rows},
        made.gates,
        made.time,
        made.findings,
        made.problems,
        made.remarks,
        made.lead_changes,
        tuple(Unmapped(*row) for row in made.unmapped),
        made.output_scale,
        made.apart,
        made.paused,
    )


def ids(contents: Contents) -> Ids:
    """The ids of a log."""
    rows = tuple(Id(*key, n) for key, n in sorted(contents.frames.items()))
    apart = contents.apart
    frames = sum(row.frames for row in rows) + sum(apart.values())
    return Ids(frames, contents.duration, rows, apart, contents.paused)
