"""Frames and logs that the tests of several formats share."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from canid.io.buses import messages, python_can
from canid.values.types import Flag, Frame

# every kind of frame, on two buses, at whole ms
FRAMES = [
    Frame(0.0, 0, 0x123, b"\x01\x02\xff", 0),
    Frame(0.001, 0, 0x7, b"", 0),
    Frame(0.0025, 1, 0x18FEF100, bytes(8), int(Flag.EXTENDED)),
    Frame(0.5, 0, 0x100, b"", int(Flag.REMOTE), 8),
    Frame(1.0, 1, 0x321, b"\xaa", int(Flag.TX)),
    Frame(1.5, 0, 0x55, bytes(range(16)), int(Flag.FD | Flag.BRS)),
    Frame(2.0, 1, 0x12345, bytes(64), int(Flag.FD | Flag.BRS | Flag.ESI | Flag.EXTENDED)),
    Frame(2.5, 0, 0x56, b"", int(Flag.FD)),
    Frame(3.0, 0, 0, b"", int(Flag.ERROR)),
]


def write_with_python_can(path: Path, frames: Iterable[Frame], start_utc: float) -> None:
    """Write a log with python-can's writer for its suffix."""
    with python_can.load().Logger(str(path)) as writer:
        for frame in frames:
            writer.on_message_received(messages.message_of(frame, start_utc))
