"""ASAM MDF 4 with bus logging, written block by block from docs/formats/mf4.md.

The dialects: sorted and unsorted data groups, finished and not (UnFinMF), data bytes in the record or of variable length,
members of whole bytes or of single bits, deflated blocks, a time of floats or of integers with a conversion; with IDE or
bit 31; error frames with and without data; remote frames; LIN events; channels from 0 or from 1; a cut end.
"""

from __future__ import annotations

import datetime
import random
import struct
import zlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

from tests.formats_oracle import asc_dates
from tests.formats_oracle.asc_files import ZONES
from tests.formats_oracle.written import Counts, Written, WrittenFrame

_START_NS = 1_700_000_000_123_456_789
_FD_SIZES = (12, 16, 20, 24, 32, 48, 64)
_DLC = {**{n: n for n in range(9)}, **{n: 9 + k for k, n in enumerate(_FD_SIZES)}}
_UINT, _FLOAT, _BYTES = 0, 4, 10  # cn_data_type
_VALUE, _VLSD, _MASTER = 0, 1, 2  # cn_type
_TIME = 1  # cn_sync_type
_BUS_EVENT, _PLAIN = 2, 4  # cg_flags
_VLSD_GROUP = 1
# cycle counters, length of the last DT block and size of VLSD groups are not written yet
_UNFINISHED = 1 | 4 | 32


class _File:
    """Blocks that are appended; links are filled in when their targets are known."""

    def __init__(self, unfinished: bool) -> None:
        word = b"UnFinMF " if unfinished else b"MDF     "
        flags = _UNFINISHED if unfinished else 0
        self.data = bytearray(struct.pack("<8s8s8s4xH30xHH", word, b"4.11    ", b"oracle  ", 411, flags, 0))

    def block(self, name: bytes, links: Sequence[int], data: bytes, length: int | None = None) -> int:
        """Append a block; returns its address."""
        self.data += bytes(-len(self.data) % 8)
        at = len(self.data)
        size = 24 + 8 * len(links) + len(data)
        self.data += struct.pack("<4s4xQQ", b"##" + name, size if length is None else length, len(links))
        self.data += struct.pack(f"<{len(links)}Q", *links) + data
        return at

    def link(self, block: int, number: int, target: int) -> None:
        """Fill in a link."""
        struct.pack_into("<Q", self.data, block + 24 + 8 * number, target)

    def text(self, text: str) -> int:
        """A TX block."""
        raw = text.encode() + b"\0"
        return self.block(b"TX", (), raw + bytes(-len(raw) % 8))


class _Member(NamedTuple):
    name: str
    bit: int  # from the begin of the record
    bits: int
    value: Callable[[WrittenFrame], int | bytes]
    kind: int = _UINT


class _Layout(NamedTuple):
    """The record of a group."""

    members: tuple[_Member, ...]
    size: int  # bytes
    vlsd: bool  # the data bytes stand elsewhere, and the record holds their place


class _Dialect(NamedTuple):
    unsorted: bool
    unfinished: bool
    vlsd: bool
    packed: bool
    deflated: bool
    integer_time: bool
    ide: bool
    local_time: bool  # of the start, in a zone that the file does not name
    first_channel: int


def _group_name(frame: WrittenFrame) -> str:
    if "error" in frame.marks:
        return "CAN_ErrorFrame"
    return "CAN_RemoteFrame" if "remote" in frame.marks else "CAN_DataFrame"


def _layout(kind: str, how: _Dialect, rng: random.Random, width: int) -> _Layout:
    """Members of a group, behind its time of 8 bytes."""
    fd = kind == "CAN_DataFrame"
    members: list[tuple[str, int, Callable[[WrittenFrame], int | bytes]]] = []

    def add(name: str, bits: int, value: Callable[[WrittenFrame], int | bytes]) -> None:
        members.append((name, bits, value))

    flag = 0 if how.ide else 1 << 31
    id_bits = 29 if how.packed and how.ide else 32
    add("ID", id_bits, lambda frame: frame.id | (flag if frame.extended else 0))
    if how.ide:
        add("IDE", 1, lambda frame: int(frame.extended))
    add("BusChannel", 2, lambda frame: frame.bus + how.first_channel)
    add("DLC", 4, lambda frame: frame.asked if frame.asked >= 0 else _DLC[len(frame.data)])
    if kind != "CAN_RemoteFrame":
        add("DataLength", 7, lambda frame: len(frame.data))
    add("Dir", 1, lambda frame: int(frame.sent))
    if fd:
        for name, mark in (("EDL", "fd"), ("BRS", "brs"), ("ESI", "esi")):
            add(name, 1, lambda frame, mark=mark: int(mark in frame.marks))
    head = members[1:]
    rng.shuffle(head)
    placed, bit = [], 64
    for name, bits, value in [members[0], *head]:
        if not how.packed:
            bits = -(-bits // 8) * 8
        # a packed number may lie across bytes, as CANedge's ID does
        placed.append(_Member(name, bit, bits, value))
        bit += bits
    bit = -(-bit // 8) * 8
    vlsd = how.vlsd and kind == "CAN_DataFrame"
    if kind == "CAN_ErrorFrame" and rng.random() < 0.4:
        # some devices write a number where bytes should stand
        placed.append(_Member("DataBytes", bit, 32, lambda frame: frame.data.ljust(4, b"\0")))
        bit += 32
    elif kind != "CAN_RemoteFrame":
        size = 8 if vlsd else width
        placed.append(
            _Member("DataBytes", bit, 8 * size, lambda frame: frame.data.ljust(size, b"\0"), _BYTES)
        )
        bit += 8 * size
    return _Layout(tuple(placed), bit // 8, vlsd)


def _record(layout: _Layout, frame: WrittenFrame, time: bytes, place: int) -> bytes:
    bits = int.from_bytes(time, "little")
    for one in layout.members:
        value = one.value(frame)
        if one.name == "DataBytes" and layout.vlsd:
            value = place
        number = int.from_bytes(value, "little") if isinstance(value, bytes) else value
        assert number < 1 << one.bits
        bits |= number << one.bit
    return bits.to_bytes(layout.size, "little")


def _time(frame: WrittenFrame, how: _Dialect) -> bytes:
    return struct.pack("<Q", frame.ns) if how.integer_time else struct.pack("<d", frame.ns / 1e9)


def _channel(
    file: _File, name: str, place: tuple[int, int], kinds: tuple[int, int, int], conversion: int = 0
) -> int:
    bit, bits = place
    kind, sync, data = kinds
    flags = 0x400 if name.startswith("CAN_") else 0  # bus event
    fixed = struct.pack(
        "<BBBBIIIIBBH6d", kind, sync, data, bit % 8, bit // 8, bits, flags, 0, 0, 0, 0, *[0.0] * 6
    )
    return file.block(b"CN", (0, 0, file.text(name), 0, conversion, 0, 0, 0), fixed)


def _channels(file: _File, kind: str, layout: _Layout, how: _Dialect) -> tuple[int, int]:
    """The channels of a group: its time, and the structure with its members. Returns the first, and that of the bytes."""
    conversion = 0
    if how.integer_time:
        linear = struct.pack("<BBHHHdd2d", 1, 0, 0, 0, 2, 0.0, 0.0, 0.0, 1e-9)
        conversion = file.block(b"CC", (0, 0, 0, 0), linear)
    data_type = _UINT if how.integer_time else _FLOAT
    time = _channel(file, "t", (0, 64), (_MASTER, _TIME, data_type), conversion)
    whole = _channel(file, kind, (64, 8 * layout.size - 64), (_VALUE, 0, _BYTES))
    file.link(time, 0, whole)
    before, at_bytes = 0, 0
    for one in layout.members:
        is_vlsd = layout.vlsd and one.name == "DataBytes"
        kinds = (_VLSD if is_vlsd else _VALUE, 0, one.kind)
        member = _channel(file, f"{kind}.{one.name}", (one.bit, one.bits), kinds)
        if is_vlsd:
            at_bytes = member
        if before:
            file.link(before, 0, member)
        else:
            file.link(whole, 1, member)
        before = member
    return time, at_bytes


def _source(file: _File, bus_type: int) -> int:
    return file.block(b"SI", (file.text("bus"), file.text("bus"), 0), struct.pack("<BBB5x", 2, bus_type, 0))


def _group(
    file: _File, channels: int, name: str, numbers: tuple[int, int, int, int], bus_type: int = 2
) -> int:
    record, cycles, size, flags = numbers
    fixed = struct.pack("<QQHH4xII", record, cycles, flags, ord("."), size, 0)
    source = _source(file, bus_type) if channels else 0
    return file.block(b"CG", (0, channels, file.text(name) if channels else 0, source, 0, 0), fixed)


def _head(file: _File, how: _Dialect) -> int:
    start = struct.pack("<QhhBBBxdd", _START_NS, 0, 0, int(how.local_time), 0, 0, 0.0, 0.0)
    head = file.block(b"HD", (0,) * 6, start)
    history = file.block(
        b"FH",
        (0, file.text("<FHcomment><TX>oracle</TX></FHcomment>")),
        struct.pack("<QhhB3x", _START_NS, 0, 0, 0),
    )
    file.link(head, 1, history)
    return head


def _stored(file: _File, kind: bytes, data: bytes, deflated: bool) -> int:
    if not deflated or not data:
        return file.block(kind, (), data)
    packed = zlib.compress(data)
    head = struct.pack("<2sBxIQQ", kind, 0, 0, len(data), len(packed))
    return file.block(b"DZ", (), head + packed)


def _lin(file: _File, before: int, rng: random.Random) -> int:
    """A data group of LIN events, which are no CAN frames. Returns how many there are."""
    n = rng.randint(1, 5)
    time = _channel(file, "t", (0, 64), (_MASTER, _TIME, _FLOAT))
    member = _channel(file, "LIN_Frame.ID", (64, 8), (_VALUE, 0, _UINT))
    whole = _channel(file, "LIN_Frame", (64, 8), (_VALUE, 0, _BYTES))
    file.link(time, 0, whole)
    file.link(whole, 1, member)
    group = _group(file, time, "LIN", (0, n, 9, _BUS_EVENT | _PLAIN), 3)
    data = file.block(b"DT", (), b"".join(struct.pack("<dB", k * 0.1, k) for k in range(n)))
    file.link(before, 0, file.block(b"DG", (0, group, data, 0), bytes(8)))
    return n


def _sorted_file(
    frames: Sequence[WrittenFrame], how: _Dialect, rng: random.Random, width: int
) -> tuple[bytes, int]:
    file = _File(False)
    before = _head(file, how)
    for kind in sorted({_group_name(frame) for frame in frames}):
        of = [frame for frame in frames if _group_name(frame) == kind]
        layout = _layout(kind, how, rng, width)
        channels, at_bytes = _channels(file, kind, layout, how)
        rows, stream = [], bytearray()
        for frame in of:
            rows.append(_record(layout, frame, _time(frame, how), len(stream)))
            stream += struct.pack("<I", len(frame.data)) + frame.data
        if at_bytes:
            file.link(at_bytes, 5, _stored(file, b"SD", bytes(stream), how.deflated))
        group = _group(file, channels, kind, (0, len(of), layout.size, _BUS_EVENT | _PLAIN))
        data = _stored(file, b"DT", b"".join(rows), how.deflated)
        new = file.block(b"DG", (0, group, data, 0), bytes(8))
        file.link(before, 0, new)
        before = new
    others = _lin(file, before, rng) if rng.random() < 0.3 else 0
    return bytes(file.data), others


def _unsorted_file(
    frames: Sequence[WrittenFrame], how: _Dialect, rng: random.Random, width: int
) -> tuple[bytes, list[tuple[int, int]]]:
    """One data group of all records in the order of time. Also where each frame's record, and its bytes, end."""
    file = _File(how.unfinished)
    head = _head(file, how)
    kinds = sorted({_group_name(frame) for frame in frames})
    layouts = {kind: _layout(kind, how, rng, width) for kind in kinds}
    numbers = {kind: 1 + 2 * k for k, kind in enumerate(kinds)}
    rows: list[tuple[bytes, int, int]] = []
    streams = dict.fromkeys(kinds, 0)
    size = 0
    for frame in frames:
        kind = _group_name(frame)
        row = bytes([numbers[kind]]) + _record(layouts[kind], frame, _time(frame, how), streams[kind])
        end = len(row)
        if layouts[kind].vlsd:
            row += bytes([numbers[kind] + 1]) + struct.pack("<I", len(frame.data)) + frame.data
            streams[kind] += 4 + len(frame.data)
        rows.append((row, size + end, size + len(row)))
        size += len(row)
    first = before = 0
    for kind in kinds:
        of = sum(_group_name(frame) == kind for frame in frames)
        layout = layouts[kind]
        channels, at_bytes = _channels(file, kind, layout, how)
        cycles = 0 if how.unfinished else of
        groups = [_group(file, channels, kind, (numbers[kind], cycles, layout.size, _BUS_EVENT | _PLAIN))]
        if layout.vlsd:
            total = 0 if how.unfinished else streams[kind]
            groups.append(_group(file, 0, "", (numbers[kind] + 1, cycles, total, _VLSD_GROUP)))
            file.link(at_bytes, 5, groups[1])
        for group in groups:
            first = first or group
            if before:
                file.link(before, 0, group)
            before = group
    group_of_data = file.block(b"DG", (0, first, 0, 0), bytes([1]) + bytes(7))
    file.link(head, 0, group_of_data)
    data = file.block(b"DT", (), b"".join(row for row, _, _ in rows), 24 if how.unfinished else None)
    file.link(group_of_data, 2, data)
    return bytes(file.data), [(data + 24 + end, data + 24 + whole) for _, end, whole in rows]


def _frames(how: _Dialect, rng: random.Random) -> list[WrittenFrame]:
    n = rng.randint(3, 60)
    fd = rng.random() < 0.4
    kinds = [frozenset[str](), *([frozenset({"remote"}), frozenset({"error"})] if rng.random() < 0.6 else [])]
    buses = rng.choice([(0,), (0, 1), (1, 2)]) if how.first_channel else rng.choice([(0,), (0, 1)])
    frames, ns = [], 0
    for k in range(n):
        extended = rng.random() < 0.5
        # without an IDE channel small ids of 29 bits are what bit 31 is for
        id_ = rng.choice((rng.randrange(0x800), rng.randrange(1 << 29))) if extended else rng.randrange(0x800)
        marks = rng.choice(kinds) if k else kinds[0]
        size, asked = rng.randint(0, 8), -1
        if marks == {"remote"}:
            size, asked = 0, rng.randint(0, 8)
        elif not marks and fd and rng.random() < 0.6:
            marks = frozenset({"fd", *(mark for mark in ("brs", "esi") if rng.random() < 0.5)})
            size = rng.choice((*range(9), *_FD_SIZES))
        elif marks == {"error"}:
            size = rng.randint(0, 4)
        # the first one is on the first bus: a file whose channels begin at 0 shows it
        bus = buses[0] if not k else rng.choice(buses)
        frames.append(
            WrittenFrame(ns, bus, id_, extended, rng.randbytes(size), marks, rng.random() < 0.3, asked)
        )
        ns += rng.choice((0, 1000, 250_000, 10_000_000, 1_000_000_000))
    return frames


def draw(rng: random.Random) -> Written:
    """A file and its frames."""
    unsorted = rng.random() < 0.5
    how = _Dialect(
        unsorted,
        unsorted and rng.random() < 0.7,
        vlsd=rng.random() < 0.5,
        packed=rng.random() < 0.5,
        deflated=not unsorted and rng.random() < 0.4,
        integer_time=rng.random() < 0.5,
        ide=rng.random() < 0.7,
        local_time=rng.random() < 0.3,
        first_channel=rng.choice((0, 1, 1)),
    )
    frames = _frames(how, rng)
    width = max((len(frame.data) for frame in frames), default=0)
    width = rng.choice((64, max(width, 8)))
    damaged, others = 0, 0
    if unsorted:
        content, ends = _unsorted_file(frames, how, rng, width)
        if how.unfinished and rng.random() < 0.5 and len(frames) > 5:
            cut = rng.randint(ends[2][1], len(content))
            content = content[:cut]
            # a record whose bytes are missing is seen to be missing; of half a record nothing is left
            damaged = sum(
                end <= cut < whole and bool(frame.data)
                for (end, whole), frame in zip(ends, frames, strict=True)
            )
            frames = [
                frame
                for (end, whole), frame in zip(ends, frames, strict=True)
                if whole <= cut or (end <= cut and not frame.data)
            ]
    else:
        content, others = _sorted_file(frames, how, rng, width)
    words = [name.replace("_", " ") for name in how._fields if getattr(how, name) is True]
    words += [f"channels from {how.first_channel}", *(["cut"] if damaged else [])]
    counts = Counts(others=others, damaged=damaged)
    # groups have no order between each other: frames of one time come group by group
    frames.sort(key=lambda frame: (frame.ns, _group_name(frame)))
    zone, start = rng.choice(ZONES), _START_NS + frames[0].ns
    if how.local_time:
        whole = datetime.datetime(1970, 1, 1) + datetime.timedelta(microseconds=_START_NS // 1000)
        start = asc_dates.epoch_ns(whole, zone) + _START_NS % 1000 + frames[0].ns
    return Written(content, ".mf4", tuple(frames), counts, tuple(words), start, zone)
