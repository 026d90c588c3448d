"""Logs whose numbers are any at all, in every format, and what a reader has to make of each line: that number, or damage."""

from __future__ import annotations

import base64
import struct
import zlib
from typing import NamedTuple

# what each column holds: times of 146 years, ids of 11 and 29 bits, buses of two bytes, bytes of a classic frame
MAX_NS, MAX_STANDARD, MAX_EXTENDED, MAX_BUS, MAX_LENGTH = 1 << 62, 0x7FF, 0x1FFFFFFF, 0xFFFE, 8
# numbers at the edges of types, and far beyond
EDGES = (
    *(0, 1, 8, 9, 15, 16, 64, 65, 255, 256, 0x7FF, 0x800, 0xFFFE, 0xFFFF, 0x10000, 0x1FFFFFFF, 0x20000000),
    *(
        0x7FFFFFFF,
        0x80000000,
        0xFFFFFFFF,
        1 << 32,
        MAX_NS // 10**9,
        1 << 53,
        1 << 63,
        1 << 64,
        10**19,
        10**400,
    ),
)
SUFFIXES = (".log", ".asc", ".csv", ".trc", ".blf")


class Numbers(NamedTuple):
    """The numbers of one line or object."""

    seconds: int
    bus: int
    id: int
    extended: bool
    length: int  # bytes, as announced; so many are there, up to 8

    @property
    def data(self) -> bytes:
        """The bytes that are there."""
        return bytes(range(min(self.length, MAX_LENGTH)))

    @property
    def possible(self) -> bool:
        """Whether a log's columns can hold them."""
        return (
            self.seconds * 10**9 <= MAX_NS
            and self.bus <= MAX_BUS
            and self.id <= (MAX_EXTENDED if self.extended else MAX_STANDARD)
            and self.length <= MAX_LENGTH
        )


def log(suffix: str, lines: list[Numbers], relative: bool = False) -> tuple[bytes, list[Numbers | None]]:
    """A log, and for each line the numbers that are read; None: it is damaged."""
    if suffix == ".blf":
        return _blf(lines)
    head, make = {
        ".log": ("", _candump),
        ".asc": (f"base hex timestamps {'relative' if relative else 'absolute'}\n", _asc),
        ".csv": ("timestamp,arbitration_id,extended,remote,error,dlc,data\n", _csv),
        ".trc": (";$FILEVERSION=2.1\n;$STARTTIME=0\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n", _trc),
    }[suffix]
    text = "".join(make(one) + "\n" for one in lines)
    expected: list[Numbers | None] = []
    now = 0
    for one in lines:
        # of an .asc with relative times the time is the sum so far; one that is none is left out of it
        read = one._replace(seconds=now + one.seconds) if relative and suffix == ".asc" else one
        if suffix == ".csv":
            read = read._replace(bus=0)
        if suffix == ".log":
            read = read._replace(bus=0, length=min(one.length, MAX_LENGTH))
            if one.extended and MAX_EXTENDED < one.id <= 2 * MAX_EXTENDED + 1:
                read = read._replace(id=one.id & MAX_EXTENDED)  # an error frame
        if suffix in (".asc", ".trc") and one.length <= 15:
            read = read._replace(length=min(one.length, MAX_LENGTH))  # a DLC: 9 to 15 mean 8 bytes
        fits = read.possible and not (suffix == ".trc" and one.bus > 998)
        if relative and read.seconds * 10**9 <= MAX_NS:
            now = read.seconds
        expected.append(read if fits else None)
    return (head + text).encode(), expected


def _candump(one: Numbers) -> str:
    # eight digits are an extended id: a larger one of 11 bits has nine here
    id_ = f"{one.id:0{8 if one.extended else 3 if one.id < 1 << 24 else 9}X}"
    return f"({one.seconds}.000000) can0 {id_}#{one.data.hex()}"


def _asc(one: Numbers) -> str:
    id_ = f"{one.id:X}{'x' if one.extended else ''}"
    return f" {one.seconds}.000000 {one.bus + 1}  {id_} Rx d {one.length:x} {one.data.hex(' ')}"


def _csv(one: Numbers) -> str:
    data = base64.b64encode(one.data).decode()
    return f"{one.seconds}.0,{one.id:#x},{int(one.extended)},0,0,{one.length},{data}"


def _trc(one: Numbers) -> str:
    id_ = f"{one.id:0{8 if one.extended else 4 if one.id < 1 << 16 else 9}X}"
    return f"1 {one.seconds * 1000}.000 DT {one.bus + 1} {id_} Rx - {one.length} {one.data.hex(' ')}"


def _blf(lines: list[Numbers]) -> tuple[bytes, list[Numbers | None]]:
    """Objects of one container; a number that a field has no bits for is what its bits say."""
    objects, expected = b"", []
    for one in lines:
        ns, word = one.seconds * 10**9 & (1 << 64) - 1, one.id & 0x7FFFFFFF | one.extended << 31
        channel, dlc = max(one.bus + 1 & 0xFFFF, 1), one.length & 0xFF
        objects += struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 48, 1, 2, 0, 0, ns)
        objects += struct.pack("<HBBL8s", channel, 0, dlc, word, bytes(range(8)))
        signed = ns - (1 << 64) if ns >> 63 else ns
        # the container has a checksum: an id too large for 11 bits without the mark of 29 is what the writer wrote
        number = one.id & 0x7FFFFFFF
        kept = Numbers(signed, channel - 1, number, one.extended or number > MAX_STANDARD, min(dlc, 8))
        sound = abs(signed) < MAX_NS and number <= MAX_EXTENDED and dlc <= 15
        expected.append(kept if sound else None)
    packed = zlib.compress(objects)
    size = 32 + len(packed)
    container = (
        struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10) + struct.pack("<H6xL4x", 2, len(objects)) + packed
    )
    header = struct.pack(
        "<4sL8BQQLL", b"LOGG", 144, *bytes(8), 144 + size, 144 + 32 + len(objects), len(lines), 0
    )
    return header.ljust(144, b"\0") + container + b"\0" * (size % 4), expected
