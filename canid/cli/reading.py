"""Reading a log for a verb: warnings of the vehicle file, progress, the log's health, and the exit code of a damaged log."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from canid.cli.output.messages import info
from canid.cli.output.progress import Progress
from canid.errors import DAMAGED, DONE

if TYPE_CHECKING:
    from canid.drive_reader import Drive, Health
    from canid.vehicle import Vehicle


def read_vehicle(name: str) -> Vehicle:
    """Read a vehicle file, and report its warnings. Raises ConfigError."""
    from canid import vehicle

    read = vehicle.read_vehicle(name)
    for warning in read.warnings:
        info(warning)
    return read


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
    from canid import drive_reader
    from canid.logs import open_log

    log = open_log(path)
    with Progress(f"reading {path}") as bar:
        return drive_reader.read_drive(
            path, vehicle, start=args.start, stop=args.stop, log=log, progress=bar.to, **settings
        )


def report_health(health: Health, name: str = "") -> int:
    """Report what was wrong with a log, a line each; returns the exit code that it deserves.

    `name`: of the log, where there are several.
    """
    from canid.views import end_summary

    for line in end_summary.health(health.damage, health.back_in_time, health.counters, health.missing):
        info(f"{name}: {line}" if name else line)
    return DAMAGED if health.damage or health.back_in_time else DONE
