"""A sender process: numbered frames at a rate over udp_multicast, with strange datagrams between them.

Arguments: group, port, frames/s (inf: as fast as it goes), frames in all (-1: until standard input ends), file for the
times, seed, and how many strange datagrams come per good frame. It says "begun" with the first frame. A script that
imports nothing of this project: the sender is a stranger.
"""

from __future__ import annotations

import array
import random
import socket
import struct
import sys
import threading
import time
from typing import Any

import msgpack

PAUSE_S = 0.001
FIELDS: dict[str, Any] = {
    "timestamp": 0.0,
    "arbitration_id": 0,
    "is_extended_id": False,
    "is_remote_frame": False,
    "is_error_frame": False,
    "channel": None,
    "dlc": 8,
    "data": b"",
    "is_fd": False,
    "bitrate_switch": False,
    "error_state_indicator": False,
}
NUMBERS = (0, 1, 8, 9, 64, 65, 80, 0x7FF, 0x800, 2**29, 2**31, 2**32, 2**63, -1)
SPECIAL = (float("inf"), float("-inf"), float("nan"), None, True, False, "", "x", b"", [], {})

# what stands before, between and behind the id (as uint16) and the data of a packed frame
_HEAD, _, _REST = bytes(msgpack.packb(FIELDS | {"arbitration_id": 0x7FF, "data": b"\xee" * 8})).partition(
    b"\xcd\x07\xff"
)
_MIDDLE, _, _TAIL = _REST.partition(b"\xee" * 8)


def good(i: int) -> bytes:
    """Frame i: its number, and bytes that compress no better than a vehicle's (as tests.fixtures.traffic)."""
    data = i.to_bytes(4, "big") + (i * 2654435761 & 0xFFFFFFFF).to_bytes(4, "big")
    return _HEAD + b"\xcd" + (i % 2048).to_bytes(2, "big") + _MIDDLE + data + _TAIL


def value(rng: random.Random, depth: int = 0) -> Any:
    """Any object that msgpack has."""
    kind = rng.randrange(7 if depth < 3 else 5)
    if kind == 0:
        return rng.choice(NUMBERS)
    if kind == 1:
        return rng.choice(SPECIAL)
    if kind == 2:
        return rng.choice((rng.getrandbits(64), -rng.getrandbits(63), rng.uniform(-1e9, 1e9)))
    if kind == 3:
        return rng.randbytes(rng.choice((0, 1, 7, 8, 9, 63, 64, 65, 200)))
    if kind == 4:
        return "".join(chr(rng.randrange(1, 0xD800)) for _ in range(rng.randrange(8)))
    if kind == 5:
        return [value(rng, depth + 1) for _ in range(rng.randrange(4))]
    return {str(value(rng, 3)): value(rng, depth + 1) for _ in range(rng.randrange(4))}


def strange(rng: random.Random) -> bytes:
    """A frame with some fields replaced or missing, any object, or bytes that are no msgpack; never a numbered one."""
    fields = FIELDS | {"arbitration_id": 0x7F1, "data": b"\xee" * 8}
    kind = rng.randrange(6)
    if kind <= 2:
        for name in rng.sample([*FIELDS, "extra"], rng.randrange(1, 5)):
            fields[name] = value(rng)
    elif kind == 3:
        for name in rng.sample(list(FIELDS), rng.randrange(1, 5)):
            del fields[name]
    elif kind == 4:
        return bytes(msgpack.packb(value(rng)))
    else:
        return rng.randbytes(rng.choice((0, 1, 2, 50, 1000, 9000)))
    data = bytes(msgpack.packb(fields))
    return data if rng.random() < 0.8 else data[: rng.randrange(len(data))]


def main(group: str, port: int, rate: float, total: int, path: str, seed: str, share: float) -> None:
    """Send, and write down the wall clock before each frame and the number of strange datagrams."""
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    rng = random.Random(seed)
    sent, foreign = array.array("d"), 0
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    began = time.monotonic()
    while not ended.is_set() and len(sent) != total:
        due = (time.monotonic() - began) * rate if rate < float("inf") else len(sent) + 50
        while len(sent) < due and len(sent) != total:
            data = good(len(sent))
            now = time.time()
            out.sendto(data, (group, port))
            sent.append(now)
            if len(sent) == 1:
                print("begun", flush=True)
            if share and rng.random() < share:
                out.sendto(strange(rng), (group, port))
                foreign += 1
        time.sleep(PAUSE_S)
    with open(path, "wb") as file:
        file.write(struct.pack("<q", foreign) + sent.tobytes())


if __name__ == "__main__":
    a = sys.argv[1:]
    main(a[0], int(a[1]), float(a[2]), int(a[3]), a[4], a[5], float(a[6]))
