"""Drives of the two outside simulators, under the benchmark's name; they are in tests/plants/outside_drives.py."""

from __future__ import annotations

from tests.plants.outside_drives import (
    Drive,
    Truth,
    accel_drive,
    drawn_drive,
    helly_drive,
    read_table,
    write_table,
)
from tests.plants.quoted_intervals import Quoted, identified, quoted, trace

__all__ = [
    "Drive",
    "Quoted",
    "Truth",
    "accel_drive",
    "drawn_drive",
    "helly_drive",
    "identified",
    "quoted",
    "read_table",
    "trace",
    "write_table",
]
