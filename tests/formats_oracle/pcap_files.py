"""Files of tcpdump and Wireshark, .pcap and .pcapng, written from docs/formats/pcap.md alone."""

from __future__ import annotations

import random
import struct
from typing import NamedTuple

from tests.formats_oracle.drawn_frames import drawn
from tests.formats_oracle.written import Counts, Written, WrittenFrame

START_S = 1_700_000_000
LINKS = (227, 227, 113, 276)
# names of interfaces of one file, and the bus of each
NAMES = (
    {"can0": 0},
    {"can1": 1},
    {"vcan0": 0, "vcan3": 3},
    {"body": 0, "powertrain": 1},
    {"": 0},
    {"": 0, " ": 1},
)


class Side(NamedTuple):
    """An interface as it is written."""

    number: int
    link: int
    resolution: int
    offset: int
    index: int  # in the computer


def draw(rng: random.Random) -> Written:
    """One file of either format."""
    return _pcap(rng) if rng.random() < 0.5 else _pcapng(rng)


def packet(one: WrittenFrame, link: int, order: str, index: int, rng: random.Random) -> bytes:
    """A frame behind its link's header."""
    fd = "fd" in one.marks
    marked = fd and (link == 227 or rng.random() < 0.5)
    can_id = one.id | one.extended << 31 | ("remote" in one.marks) << 30 | ("error" in one.marks) << 29
    length = max(one.asked, 0) if "remote" in one.marks else len(one.data)
    flags = ("brs" in one.marks) | ("esi" in one.marks) << 1 | marked << 2
    room = rng.choice((length, 64 if fd else 8)) if marked or not fd else 64
    if link != 227 and fd:
        room = rng.choice((length, 64))
    frame = struct.pack(f"{'>' if link == 227 else order}IBBBB", can_id, length, flags, 0, 0)
    frame += one.data.ljust(room, b"\0") if "remote" not in one.marks else bytes(rng.choice((0, 8)))
    if link == 227:
        return frame
    protocol, kind = 0x0D if fd else 0x0C, 4 if one.sent else 0
    if link == 113:
        return struct.pack(">HHH8xH", kind, 280, 0, protocol) + frame
    return struct.pack(">H2xIHBB8x", protocol, index, 280, kind, 0) + frame


def other_packet(link: int, order: str, rng: random.Random) -> bytes:
    """What is no frame of CAN or CAN FD: CAN XL, or another protocol."""
    xl = struct.pack(f"{'>' if link == 227 else order}IBBHI", 5, 0x80, 1, 3, 7) + b"abc"
    if link == 227:
        return xl
    protocol, body = rng.choice(((0x0E, xl), (0x0800, b"\x45" + bytes(30)), (0x0806, bytes(28))))
    head = (
        struct.pack(">HHH8xH", 0, 280, 0, protocol)
        if link == 113
        else struct.pack(">H2xIHBB8x", protocol, 3, 280, 0, 0)
    )
    return head + body


def _pcap(rng: random.Random) -> Written:
    order, digits, link = rng.choice("<>"), rng.choice((6, 9)), rng.choice(LINKS)
    # two interfaces are numbered by their index in the computer
    indices = rng.choice(((3,), (3, 7), (9, 12))) if link == 276 else (1,)
    frames = _all_buses(rng, tuple(range(len(indices))), link, 10 ** (9 - digits))
    start = _start(rng, digits)
    magic = 0xA1B2C3D4 if digits == 6 else 0xA1B23C4D
    out = struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, rng.choice((262144, 65535)), link)
    others = 0
    for one in frames:
        bodies = [packet(one, link, order, indices[one.bus], rng)]
        if rng.random() < 0.1:
            bodies.append(other_packet(link, order, rng))
            others += 1
        ns = start + one.ns
        for body in bodies:
            fraction = ns % 10**9 // 10 ** (9 - digits)
            original = len(body) + rng.choice((0, 0, 8))
            out += struct.pack(f"{order}4I", ns // 10**9, fraction, len(body), original) + body
    content, damaged, frames = _cut(rng, out, frames, body, others)
    what = (".pcap", f"{digits} digits", f"order {order}", f"link {link}")
    return Written(content, ".pcap", tuple(frames), Counts(0, others, damaged), what, start + frames[0].ns)


def _cut(
    rng: random.Random, out: bytes, frames: list[WrittenFrame], last: bytes, others: int
) -> tuple[bytes, int, list[WrittenFrame]]:
    """Sometimes the file ends in its last packet, of a frame."""
    if others or len(frames) < 2 or rng.random() > 0.2:
        return out, 0, frames
    return out[: -rng.randint(1, len(last) + 15)], 1, frames[:-1]


def _pcapng(rng: random.Random) -> Written:
    names = rng.choice(NAMES)
    by_bus = {bus: name.strip() for name, bus in names.items()}
    link = rng.choice((227, 113))
    frames = _all_buses(rng, tuple(by_bus), link, 1)
    start = _start(rng, 9)
    out, others = b"", 0
    pieces = [frames]
    if len(frames) > 4 and rng.random() < 0.3:  # a section more
        pieces = [frames[:3], frames[3:]]
    last = 0
    exact: list[WrittenFrame] = []
    ethernet = rng.random() < 0.3  # an interface of another kind comes first
    for piece in pieces:
        order = rng.choice("<>")
        out += _block(order, 0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1))
        sides: dict[int, Side] = {}
        number = int(ethernet)
        if ethernet:
            out += _block(order, 1, struct.pack(f"{order}HHI", 1, 0, 0))
        for bus, name in by_bus.items():
            resolution = rng.choice((6, 9, 9, 3, 12, 0x80 + 20, 0x80 + 30, 0x80 + 40))
            # 64 bits of fine units begin late
            offset = START_S - 5 if resolution in (12, 0x80 + 40) else rng.choice((0, 1000))
            sides[bus] = Side(number, link, resolution, offset, 0)
            options = _option(order, 2, name.encode()) if name else b""
            options += (
                _option(order, 9, bytes([resolution])) if resolution != 6 or rng.random() < 0.5 else b""
            )
            options += _option(order, 14, struct.pack(f"{order}q", offset)) if offset else b""
            options += bytes(4) if options else b""
            out += _block(order, 1, struct.pack(f"{order}HHI", link, 0, 0) + options)
            number += 1
        for one in piece:
            side = sides[one.bus]
            body = packet(one, link, order, 0, rng)
            ticks, ns = _ticks(start + one.ns - side.offset * 10**9, side.resolution)
            ns += side.offset * 10**9
            kind = rng.random()
            if kind < 0.1 and side.number == 0 and last:
                out += _block(order, 3, struct.pack(f"{order}I", len(body)) + body)
                ns = last
            else:
                old = kind < 0.3
                head = (
                    struct.pack(f"{order}HH", side.number, 0)
                    if old
                    else struct.pack(f"{order}I", side.number)
                )
                head += struct.pack(f"{order}4I", ticks >> 32, ticks & 0xFFFFFFFF, len(body), len(body))
                tail = _option(order, 1, b"a remark") + bytes(4) if rng.random() < 0.2 else b""
                out += _block(order, 2 if old else 6, head + body + bytes(-len(body) % 4) + tail)
            last = ns
            exact.append(one._replace(ns=ns))
            if rng.random() < 0.1:
                out += _block(order, rng.choice((4, 5, 0x0BAD)), bytes(8))
                others += 1
    first = exact[0].ns
    read = [one._replace(ns=one.ns - first) for one in exact]
    what = (".pcapng", f"link {link}", f"{len(pieces)} sections")
    return Written(out, ".pcapng", tuple(read), Counts(0, others, 0), what, first)


def _ticks(ns: int, resolution: int) -> tuple[int, int]:
    """A time in an interface's units, and what it then is in ns."""
    per_second = 1 << (resolution & 0x7F) if resolution & 0x80 else 10**resolution
    ticks = ns * per_second // 10**9
    seconds, rest = divmod(ticks, per_second)
    if resolution & 0x80:
        # 2^-33 s are less than a ns
        digits = resolution & 0x7F
        rest, per_second = rest >> max(digits - 33, 0), 1 << min(digits, 33)
    return ticks, seconds * 10**9 + rest * 10**9 // per_second


def _block(order: str, kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    length = struct.pack(f"{order}I", len(body) + 12)
    return struct.pack(f"{order}I", kind) + length + body + length


def _option(order: str, code: int, value: bytes) -> bytes:
    return struct.pack(f"{order}HH", code, len(value)) + value + bytes(-len(value) % 4)


def _start(rng: random.Random, digits: int) -> int:
    unit = 10 ** (9 - digits)
    return START_S * 10**9 + rng.randrange(10**9) // unit * unit


def _all_buses(rng: random.Random, buses: tuple[int, ...], link: int, tick_ns: int) -> list[WrittenFrame]:
    """Frames of which some are of each bus, since a bus that is silent is not in the file."""
    frames = drawn(rng, buses, fd=True, remote=True, error=True, sent=link != 227, tick_ns=tick_ns)
    missing = [bus for bus in buses if all(one.bus != bus for one in frames)]
    last = frames[-1]
    return frames + [last._replace(bus=bus, ns=max(last.ns, 0)) for bus in missing]
