"""Random .blf files, written from docs/formats/blf.md alone."""

from __future__ import annotations

import datetime
import random
import zlib
from collections.abc import Callable
from struct import pack
from typing import NamedTuple

from tests.formats_oracle import asc_dates
from tests.formats_oracle.asc_files import FD_LENGTHS, ZONES
from tests.formats_oracle.written import Counts, Written, WrittenFrame

# header bytes 8 to 15: who wrote the file
_WRITERS = {
    "python-can's header": bytes((5, 0, 0, 0, 2, 6, 8, 1)),
    "CANoe's header": bytes((2, 0, 0, 0, 4, 7, 1, 0)),
    "CANalyzer's header": bytes((0xB4, 0x1A, 0x3E, 0, 1, 6, 11, 0)),
    "header without a writer": bytes(8),
    "canid's header": bytes((5, 0, 0, 0, 2, 6, 8, 1)),
}
_MARK_AT, _MARK = 128, b"canid: UTC"
_TEN_MICROSECONDS, _NANOSECOND = 1, 2
_EXTENDED = 0x80000000


class _Stamp(NamedTuple):
    """How an object's header is written."""

    ns: int
    coarse: bool
    version: int


def _object(kind: int, body: bytes, stamp: _Stamp) -> bytes:
    unit, time = (_TEN_MICROSECONDS, stamp.ns // 10_000) if stamp.coarse else (_NANOSECOND, stamp.ns)
    head = pack("<LHHQ", unit, 0, 0, time) if stamp.version == 1 else pack("<LBBHQQ", unit, 0, 0, 0, time, 0)
    size = 16 + len(head) + len(body)
    return b"LOBJ" + pack("<HHLL", 16 + len(head), stamp.version, size, kind) + head + body


def _word(rng: random.Random) -> tuple[int, bool, int]:
    extended = rng.random() < 0.4
    number = rng.choice((rng.randrange(0x800), rng.randrange(1 << 29) if extended else 0x7FF))
    return number, extended, number | _EXTENDED * extended


_Made = tuple[bytes, WrittenFrame | None]


def _classic(rng: random.Random, stamp: _Stamp) -> _Made:
    number, extended, word = _word(rng)
    bus, direction = rng.randrange(4), rng.choice((0, 0, 1, 2))
    remote = rng.random() < 0.15
    dlc = rng.randrange(9) if rng.random() < 0.9 else rng.randrange(9, 16)
    data = rng.randbytes(min(8, dlc))
    flags = direction | 0x80 * remote | rng.choice((0, 0x20, 0x40))
    body = pack("<HBBL8s", bus + 1, flags, dlc, word, data if not remote else bytes(8))
    kind = rng.choice((1, 86))
    if kind == 86:
        body += pack("<LBBH", 225972, 117, 0, 0)
    frame = WrittenFrame(
        stamp.ns, bus, number, extended, b"" if remote else data, frozenset({"remote"} if remote else ()), direction == 1,
        min(8, dlc) if remote else -1,
    )  # fmt: skip
    # direction 2: a request, no frame on the bus
    return _object(kind, body, stamp), None if direction == 2 else frame


def _marks(fd: bool, brs: bool, esi: bool) -> frozenset[str]:
    return frozenset({"fd", *(["brs"] * brs), *(["esi"] * esi)}) if fd else frozenset()


def _fd(rng: random.Random, stamp: _Stamp) -> _Made:
    number, extended, word = _word(rng)
    bus, direction, fd = rng.randrange(4), rng.choice((0, 0, 1, 2)), rng.random() < 0.8
    brs, esi = fd and rng.random() < 0.5, fd and rng.random() < 0.2
    data = rng.randbytes(rng.choice(FD_LENGTHS) if fd else rng.randrange(9))
    dlc = FD_LENGTHS.index(len(data))
    body = pack(
        "<HBBLLBBB5x64s", bus + 1, direction, dlc, word, 0, 0, fd | brs << 1 | esi << 2, len(data), data
    )
    frame = WrittenFrame(stamp.ns, bus, number, extended, data, _marks(fd, brs, esi), direction == 1)
    return _object(100, body, stamp), None if direction == 2 else frame


def _fd64(rng: random.Random, stamp: _Stamp) -> _Made:
    number, extended, word = _word(rng)
    bus, direction, fd = rng.randrange(4), rng.choice((0, 0, 1, 2)), rng.random() < 0.8
    brs, esi = fd and rng.random() < 0.5, fd and rng.random() < 0.2
    remote = not fd and rng.random() < 0.3
    length = rng.choice(FD_LENGTHS) if fd else rng.randrange(9)
    data = b"" if remote else rng.randbytes(length)
    # what is zero at the end need not be written
    written = data
    if data and rng.random() < 0.3:
        written = data[: rng.randrange(len(data))]
        data = written.ljust(len(data), b"\0")
    request = direction == 2 or rng.random() < 0.1
    flags = fd << 12 | brs << 13 | esi << 14 | remote << 4 | rng.choice((0, 0x300000))
    # a request shows by its flag or by its direction
    if request and (direction != 2 or rng.random() < 0.5):
        flags |= 0x80
    extension = rng.randbytes(8) if rng.random() < 0.2 else b""
    offset = (16 + (16 if stamp.version == 1 else 24) + 40 + len(written)) if extension else 0
    body = pack(
        "<BBBBLLLLLLLHBBL", bus + 1, FD_LENGTHS.index(length), len(data), 0, word, 0, flags, 0, 0, 0, 0, 0,
        direction, offset, 0,
    )  # fmt: skip
    marks = frozenset({"remote"}) if remote else _marks(fd, brs, esi)
    frame = WrittenFrame(
        stamp.ns, bus, number, extended, data, marks, direction == 1, length if remote else -1
    )
    return _object(101, body + written + extension, stamp), None if request else frame


def _error_ext(rng: random.Random, stamp: _Stamp) -> _Made:
    number, extended, word = _word(rng)
    bus, data = rng.randrange(4), rng.randbytes(rng.randrange(9))
    body = pack("<HHLBBBxLLH2x8s", bus + 1, 0, 1, 0x82, 5, len(data), 0, word, 0x20A2, data)
    return _object(73, body, stamp), WrittenFrame(stamp.ns, bus, number, extended, data, frozenset({"error"}))


def _error(rng: random.Random, stamp: _Stamp) -> _Made:
    bus = rng.randrange(4)
    body = pack("<HH", bus + 1, rng.randrange(100)) + rng.choice((b"", rng.randbytes(4)))
    return _object(2, body, stamp), WrittenFrame(stamp.ns, bus, 0, False, b"", frozenset({"error"}))


def _fd_error(rng: random.Random, stamp: _Stamp) -> _Made:
    number, extended, word = _word(rng)
    bus, valid = rng.randrange(4), rng.choice(FD_LENGTHS)
    body = pack("<BBBBHHHBBL", bus + 1, FD_LENGTHS.index(valid), valid, 7, 1, 2, 3, 0, 0, word)
    body += rng.randbytes(28) + rng.randbytes(64)
    return _object(104, body, stamp), WrittenFrame(stamp.ns, bus, number, extended, b"", frozenset({"error"}))


def _other(rng: random.Random, stamp: _Stamp) -> _Made:
    """Objects that hold no frame with an id: statistics, LIN, Ethernet, texts."""
    kind = rng.choice((4, 31, 11, 71, 120, 65, 72))
    return _object(kind, rng.randbytes(rng.choice((16, 36, 61, 130))), stamp), None


_OBJECTS: tuple[Callable[[random.Random, _Stamp], _Made], ...] = (
    _classic, _classic, _classic, _fd, _fd64, _fd64, _error_ext, _error, _fd_error, _other,
)  # fmt: skip


class _Log(NamedTuple):
    """One file."""

    content: bytes
    frames: list[WrittenFrame]  # times since its zero
    others: int
    start: int | None  # epoch ns of its zero
    said: list[str]


def draw(rng: random.Random) -> Written:
    """A random file: one log or two joined, whole, not closed or cut."""
    zone = rng.choice(ZONES)
    at = asc_dates.local(rng)
    logs: list[_Log] = []
    for number in range(2 if rng.random() < 0.25 else 1):
        at += datetime.timedelta(seconds=number * rng.randrange(60, 3_000))
        logs.append(_log(rng, at, zone))
    properties = [say for log in logs for say in log.said]
    frames, content, damaged = list(logs[0].frames), logs[0].content, 0
    start = logs[0].start
    if len(logs) > 1:
        known = start is not None and logs[1].start is not None
        properties.append("joined, dates stated" if known else "joined, a date is not stated")
        shift = (logs[1].start or 0) - (start or 0) if known else frames[-1].ns
        frames += [frame._replace(ns=frame.ns + shift) for frame in logs[1].frames]
        content += logs[1].content
    # behind a container of python-can that is not full nothing begins
    if rng.random() < 0.1 and "python-can's header" not in properties:
        # the beginning of a container; where there is none, it stands as an object would
        properties.append("cut")
        content += (
            b"LOBJ"
            + pack("<HHLL", 16, 1, 900, 10)
            + pack("<H6xL4x", 2, 4000)
            + zlib.compress(rng.randbytes(500))[:200]
        )
        damaged = 1
    first = frames[0].ns
    counts = Counts(0, sum(log.others for log in logs), damaged)
    moved = tuple(frame._replace(ns=frame.ns - first) for frame in frames)
    return Written(
        content, ".blf", moved, counts, tuple(properties), None if start is None else start + first, zone
    )


def _log(rng: random.Random, at: datetime.datetime, zone: str) -> _Log:
    coarse, version = rng.random() < 0.3, rng.choice((1, 1, 2))
    frames: list[WrittenFrame] = []
    others, now, objects = 0, rng.choice((0, 5_000_000)), []
    make: Callable[[random.Random, _Stamp], _Made] = _classic
    alike = rng.random() < 0.3
    while not frames or rng.random() < 0.97:
        now += rng.choice((0, 10_000, 250_000, 1_000_000, 100_000_000)) + (
            0 if coarse else rng.randrange(1000)
        )
        if not alike:
            make = rng.choice(_OBJECTS)
        item, frame = make(rng, _Stamp(now, coarse, version))
        objects.append(item)
        if frame is None:
            others += 1
        else:
            frames.append(frame)
    writer = rng.choice(sorted(_WRITERS))
    body, inflated, how = _containers(rng, objects, writer)
    stated = rng.random() < 0.85
    words = (
        at.year,
        at.month,
        at.isoweekday() % 7,
        at.day,
        at.hour,
        at.minute,
        at.second,
        at.microsecond // 1000,
    )
    closed = rng.random() < 0.8
    sizes = (144 + len(body), inflated, len(objects)) if closed else (0, 0, 0)
    head = b"LOGG" + pack("<L", 144) + _WRITERS[writer] + pack("<QQLL", *sizes, 0)
    head = (head + pack("<8H8H", *(words if stated else (0,) * 8), *(0,) * 8)).ljust(144, b"\0")
    if writer == "canid's header":
        head = head[:_MARK_AT] + _MARK.ljust(16, b"\0")
    start = asc_dates.epoch_ns(at, "UTC" if writer == "canid's header" else zone) if stated else None
    said = [writer, how, "10 µs" if coarse else "1 ns", f"object headers of version {version}"]
    said += ["not closed"] * (not closed) + ["start not stated"] * (not stated)
    return _Log(head + body, frames, others, start, said)


def _containers(rng: random.Random, objects: list[bytes], writer: str) -> tuple[bytes, int, str]:
    """The file's body, its size when inflated as its header counts it, and how it is written."""
    data = b"".join(item + bytes(len(item) % 4) for item in objects)
    if rng.random() < 0.1:
        return data, 144 + len(data), "without containers"
    # python-can's are of 128 KiB: a shorter one that is followed by another is of an older canid, with UTC
    size = 0x20000 if writer == "python-can's header" else rng.choice((200, 1000, 0x20000))
    method = rng.choice((0, 2, 2, 2))
    out, inflated = [], 144
    for begin in range(0, len(data), size):
        part = data[begin : begin + size]
        packed = zlib.compress(part, rng.choice((1, 6, 9))) if method else part
        head = b"LOBJ" + pack("<HHLL", 16, 1, 32 + len(packed), 10) + pack("<H6xL4x", method, len(part))
        out.append(head + packed + bytes((32 + len(packed)) % 4))
        inflated += 32 + len(part)
    return b"".join(out), inflated, "containers deflated" if method else "containers stored"
