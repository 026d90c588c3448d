"""Reading a log for a verb: warnings of the vehicle file, progress, the log's health, and the exit code of a damaged log."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from canid.ui.terminal.messages import info
from canid.ui.terminal.progress import Progress
from canid.values.bus_names import NamedBus
from canid.values.errors import DAMAGED, DONE, NO_BUS
from canid.values.types import Flag

if TYPE_CHECKING:
    from canid.analysis.drive.drive_reader import Drive, Health
    from canid.io.logs import Log
    from canid.signals.vehicle import Vehicle
    from canid.ui.views.document.document import Source
    from canid.values.types import Frame


def read_vehicle(name: str) -> Vehicle:
    """Read a vehicle file, and report its warnings. Raises ConfigError."""
    from canid.signals import vehicle

    read = vehicle.read_vehicle(name)
    for warning in read.warnings:
        info(warning)
    return read


def on_buses(vehicle: Vehicle, log: Log) -> Vehicle:
    """The vehicle on the buses of a log; reports where the log's one bus is taken for another number."""
    from canid.signals import vehicle as vehicles

    log.know(vehicle.messages)
    moved = vehicles.on_buses(vehicle, log.buses)
    if moved is not vehicle and len(log.buses) == 1:
        (name, number), *_ = log.buses.items()
        before = next(m.bus for m in vehicle.messages if m.bus is not None)
        if not isinstance(before, NamedBus):
            info(
                f"{log.path}: {name}, its one bus, is bus {number}; taken for bus {before} of {vehicle.name}"
            )
    return moved


def read_drive(path: str, vehicle: Vehicle, args: argparse.Namespace, **settings: Any) -> Drive:
    """Read the part of a log from --start to --stop, with a progress bar.

    Args:
        path: the log.
        vehicle: from `read_vehicle`.
        args: with `start` and `stop`, s.
        settings: of `drive_reader.read_drive`.

    Raises:
        LogError: nothing can be read, or nothing of it is mapped.
    """
    from canid.analysis.drive import drive_reader
    from canid.io.logs import open_log

    log = open_log(path)
    vehicle = on_buses(vehicle, log)
    with Progress(f"reading {path}") as bar:
        return drive_reader.read_drive(
            path, vehicle, start=args.start, stop=args.stop, log=log, progress=bar.to, **settings
        )


# kinds of lines that every log has, which say nothing about this one; and copies, which a remark is about
_USUAL_KINDS = {"header lines", "comments", "log and trigger events", "copies of frames"}


def report_log(log: Log) -> None:
    """Report how a log was read that was shown as a whole: decisions of its reader, and what is in it besides frames."""
    for line in (log.start_says, *log.remarks):
        if line:
            info(line)
    if set(log.other_kinds) - _USUAL_KINDS:
        info(f"besides the frames: {log.others_says}")


def report_silence(duration: float, errors: int = 0) -> int:
    """Say that a bus gave nothing but error frames in `duration` s, and what to do; returns the exit code."""
    from canid.ui.cli.health_lines import SILENT_BUS

    but = f" but {errors:,} error frames" if errors else ""
    info(f"no frames received in {duration:g} s{but}: {SILENT_BUS}")
    return NO_BUS


def counted(frames: Iterable[Frame], counts: Counter[bool]) -> Iterator[Frame]:
    """The same frames; counts error frames (True) and all others."""
    for frame in frames:
        counts[bool(frame.flags & Flag.ERROR)] += 1
        yield frame


def damage(drives: Iterable[Drive]) -> str | None:
    """What could not be read of logs, as JSON has it; None: nothing."""
    return "; ".join(drive.health.damage.says for drive in drives if drive.health.damage) or None


def source(path: str, vehicle: Vehicle, command: str, health: Health) -> Source:
    """What the page of a drive was made from; `command` makes it again."""
    from canid.ui.cli.provenance import provenance
    from canid.ui.views import end_summary
    from canid.ui.views.document.document import Source

    wrong = end_summary.health(health.damage, health.back_in_time, health.counters, health.said)
    return Source(
        provenance([path], vehicle, command), vehicle.name, wrong, bool(health.damage or health.back_in_time)
    )


def report_health(health: Health, name: str = "") -> int:
    """Report what was wrong with a log, a line each; returns the exit code that it deserves.

    `name`: of the log, where there are several.
    """
    from canid.ui.views import end_summary

    for line in end_summary.health(health.damage, health.back_in_time, health.counters, health.said):
        info(f"{name}: {line}" if name else line)
    return DAMAGED if health.damage or health.back_in_time else DONE
