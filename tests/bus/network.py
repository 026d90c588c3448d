"""CAN network devices as the tests use them: `ip`, sockets that send numbered frames, what a recording holds."""

from __future__ import annotations

import json
import socket
import struct
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from canid.io.logs import open_log
from canid.values.types import Flag
from tests.fixtures.markers import markers


def ip(*words: str) -> None:
    """Change a network device."""
    subprocess.run(["ip", "link", *words], check=True)


def shown(device: str) -> dict[str, Any]:
    """What `ip` says of a device."""
    words = ["ip", "-j", "-details", "-statistics", "link", "show", "dev", device]
    reported = subprocess.run(words, check=True, capture_output=True).stdout
    return dict(json.loads(reported)[0])


def sending(channel: str) -> socket.socket:
    """A plain CAN socket of the standard library on one bus."""
    sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    sock.bind((channel,))
    return sock


def queued() -> int:
    """Received frames that no socket has yet, of all processors (softnet_stat, column 12 since Linux 5.10)."""
    lines = Path("/proc/net/softnet_stat").read_text().splitlines()
    return sum(int(line.split()[11], 16) for line in lines)


def send(channel: str, numbers: Iterable[int]) -> None:
    """Put numbered frames onto a bus; a new socket, since an old one has seen the bus go down."""
    with sending(channel) as sock:
        for i in numbers:
            sock.send(counted(i))


def counted(i: int) -> bytes:
    """A classic frame that carries its number (linux/can.h: struct can_frame)."""
    return struct.pack("=IB3x8s", 0x100 + i % 16, 8, struct.pack(">Q", i))


def error_frame(kind: int, data: bytes = bytes(8)) -> bytes:
    """What a CAN driver reports (linux/can.h: CAN_ERR_FLAG, linux/can/error.h)."""
    return struct.pack("=IB3x8s", 0x2000_0000 | kind, 8, data)


def numbers(recording: Path) -> list[int]:
    """The numbers in a recording of `counted` frames; error frames carry none."""
    return [int.from_bytes(f.data, "big") for f in open_log(recording) if not f.flags & Flag.ERROR]


def journal(recording: Path) -> list[dict[str, Any]]:
    """The events in the journal of a recording."""
    path = recording.with_name(recording.stem + ".events.jsonl")
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def events(recording: Path, *of_interest: str) -> list[str]:
    """The kinds of events in the journal of a recording, in their order; the log itself has the same."""
    reported = [
        (event["what"], event["says"]) for event in journal(recording) if event["what"] in of_interest
    ]
    inside = [(event.what, event.says) for event in markers(recording) if event.what in of_interest]
    assert inside == reported, "the log and the journal differ"
    return [what for what, _ in reported]


def says(recording: Path, what: str) -> list[str]:
    """What the events of one kind say."""
    return [event["says"] for event in journal(recording) if event["what"] == what]
