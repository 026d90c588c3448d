"""Packets of a capture in batches: .pcap and .pcapng (the drafts draft-ietf-opsawg-pcap, -pcapng), in either byte order."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

Octets = npt.NDArray[np.uint8]
Whole = npt.NDArray[np.int64]

# bytes that are read at once: 30,000 packets of classic CAN, as many as the other readers give in a chunk
_BATCH_BYTES = 1 << 20
# bytes of the longest packet that libpcap writes, and of a block of .pcapng; what claims more is damaged
_MAX_PACKET, _MAX_BLOCK = 1 << 18, 1 << 24
# zeros behind the packets of a batch: a header of SLL2 and a frame of CAN FD may be read from any byte on
PADDING = 20 + 72
# sections and interfaces of a file: a hundred captures of forty interfaces each, joined
_MAX_STATES = 4096
# of .pcap: byte order, and digits of the fraction of a second
_MAGIC = {
    b"\xd4\xc3\xb2\xa1": ("<", 6),
    b"\xa1\xb2\xc3\xd4": (">", 6),
    b"\x4d\x3c\xb2\xa1": ("<", 9),
    b"\xa1\xb2\x3c\x4d": (">", 9),
}
_SECTION = 0x0A0D0D0A  # the same in either byte order
_SECTION_BYTES = b"\n\r\r\n"
_BYTE_ORDER = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_HEADER_BYTES, _RECORD_BYTES, _BLOCK_BYTES = 24, 16, 12
_BAD_HEADER = "a packet's header is damaged"
# records that are tried at first whether they are alike
_TRIAL = 16
_INTERFACE, _OLD_PACKET, _SIMPLE_PACKET, _PACKET = 1, 2, 3, 6
# options of an interface
_NAME, _RESOLUTION, _OFFSET = 2, 9, 14
# of a resolution: the digits are binary
_BINARY = 0x80


class Interface(NamedTuple):
    """Where packets come from, and how their times count."""

    link: int  # LINKTYPE_...
    order: str  # "<" or ">": of the computer that captured
    name: str  # of .pcapng; "": not stated
    number: int  # within its section
    resolution: int  # if_tsresol: decimal digits of the fraction of a second, or 0x80 + binary digits
    offset: int = 0  # s that are added to each time
    longest: int = 0  # bytes of a packet that are kept; 0: all


class Packets(NamedTuple):
    """Some packets, in the order of the file."""

    interfaces: Sequence[Interface]  # so far
    octets: Octets  # in which they lie, with `PADDING` zeros behind the last
    begin: int  # byte of the file at which `octets` begins
    at: Whole  # (n,) first byte of each packet in `octets`
    length: Whole  # (n,) bytes that were captured; -1: its block is damaged
    ticks: npt.NDArray[np.uint64]  # (n,) time in units of the interface's resolution
    interface: Whole  # (n,) which interface
    timed: npt.NDArray[np.bool_]  # (n,) whether it has a time
    others: int  # blocks without packets
    single: bool  # no other interface can follow, as in .pcap


class Lost(NamedTuple):
    """Bytes that cannot be read."""

    begin: int
    end: int
    why: str


class _Cut(NamedTuple):
    """The packets of a piece of the file; `end`: of its last whole record; `why` the next one cannot be read, or ""."""

    packets: Packets
    end: int
    why: str


# (octets, byte of the file at which they begin, how many of them the file has) -> its packets
_Walk = Callable[[Octets, int, int], _Cut]


def is_capture(begin: bytes) -> bool:
    r"""Whether a file begins as a capture does.

    Example:
        >>> is_capture(b"\xd4\xc3\xb2\xa1\x02\x00"), is_capture(b"LOGG")
        (True, False)
    """
    return begin[:4] in _MAGIC or begin[:4] == _SECTION_BYTES


def packets(file: BinaryIO, size: int) -> Iterator[Packets | Lost]:
    """Packets from a file's first byte on; what cannot be read is Lost, and nothing raises.

    Args:
        file: opened in binary mode; `is_capture` of its first bytes.
        size: bytes of the file.
    """
    header = file.read(_HEADER_BYTES)
    blocks = header[:4] == _SECTION_BYTES
    if not blocks and len(header) < _HEADER_BYTES:
        yield Lost(0, size, "the file ends in its header")
        return
    walk = _pcapng() if blocks else _pcap(header)
    begin = 0 if blocks else _HEADER_BYTES
    file.seek(begin)
    carry = b""
    wanted = _BATCH_BYTES
    while more := file.read(wanted):
        data = carry + more
        cut = walk(np.frombuffer(data + bytes(PADDING), np.uint8), begin, len(data))
        yield cut.packets
        if cut.why:
            yield Lost(begin + cut.end, size, cut.why)
            return
        carry, begin = data[cut.end :], begin + cut.end
        # a record that is longer than a batch
        wanted = _BATCH_BYTES if cut.end else 2 * wanted
    if carry:
        yield Lost(begin, size, "the file ends in a packet")


def nanoseconds(packets: Packets) -> Whole:
    """Times in ns since 1970; 0: the packet has none; a time that cannot be is -1.

    Example:
        >>> zero, there = np.zeros(1, np.int64), np.ones(1, bool)
        >>> one = Interface(227, "<", "", 0, 0x80 + 10, 3)
        >>> ticks = np.array([1536], np.uint64)
        >>> nanoseconds(Packets((one,), zero, 0, zero, zero, ticks, zero, there, 0, True)).tolist()
        [4500000000]
    """
    ns = np.zeros(len(packets.at), np.int64)
    for number in np.unique(packets.interface).tolist():
        rows = np.flatnonzero((packets.interface == number) & packets.timed)
        interface = packets.interfaces[number]
        seconds, part = _split(packets.ticks[rows], interface.resolution)
        # 2^33 s are 272 years: whatever is beyond them is no time of a capture
        fits = (seconds < 1 << 33) & (abs(interface.offset) < 1 << 33)
        whole = np.where(fits, seconds, 0).astype(np.int64) + (interface.offset if fits.any() else 0)
        fits &= abs(whole) < 1 << 33
        ns[rows] = np.where(fits, np.where(fits, whole, 0) * 10**9 + part.astype(np.int64), -1)
    return ns


def _split(
    ticks: npt.NDArray[np.uint64], resolution: int
) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.uint64]]:
    """Whole seconds, and ns."""
    digits = resolution & ~_BINARY
    if resolution & _BINARY:
        if digits >= 64:
            return np.zeros_like(ticks), np.zeros_like(ticks)
        seconds = ticks >> np.uint64(digits)
        rest = ticks - (seconds << np.uint64(digits))
        # 2^-33 s are less than a ns, and 10^9 times 33 bits fit into 64
        rest >>= np.uint64(max(digits - 33, 0))
        return seconds, rest * np.uint64(10**9) >> np.uint64(min(digits, 33))
    if digits > 19:  # 64 bits are less than a second
        return np.zeros_like(ticks), np.zeros_like(ticks)
    unit = np.uint64(10**digits)
    rest = ticks % unit
    part = rest * np.uint64(10 ** (9 - digits)) if digits <= 9 else rest // np.uint64(10 ** (digits - 9))
    return ticks // unit, part


def _pcap(header: bytes) -> _Walk:
    """Records: seconds, fraction, captured and original length before each packet."""
    order, digits = _MAGIC[header[:4]]
    # the upper bits say how long a frame check sequence is
    link = struct.unpack_from(order + "I", header, 20)[0] & 0xFFFF
    interfaces = (Interface(link, order, "", 0, digits),)
    length_of = struct.Struct(order + "I").unpack_from

    def walk(octets: Octets, begin: int, n: int) -> _Cut:
        runs, at, why = _Runs(octets, n, 8, 12), 0, ""
        while at + _RECORD_BYTES <= n:
            size = _RECORD_BYTES + length_of(octets.data, at + 8)[0]
            if size > _RECORD_BYTES + _MAX_PACKET:
                why = _BAD_HEADER
                break
            if at + size > n:
                break
            at += size * runs.take(at, size)
        starts, _, _ = runs.records()
        big = np.full(len(starts), order == ">")
        seconds, fraction, length, original = (_numbers(octets, starts + k, big) for k in (0, 4, 8, 12))
        bad = np.flatnonzero((fraction >= 10**digits) | (length > original))
        if bad.size:
            at, why = int(starts[bad[0]]), _BAD_HEADER
        good = slice(int(bad[0]) if bad.size else len(starts))
        ticks = (seconds * 10**digits + fraction).astype(np.uint64)
        zero = np.zeros_like(starts[good])
        made = Packets(
            interfaces, octets, begin, starts[good] + _RECORD_BYTES, length[good], ticks[good], zero, zero == 0, 0, True
        )  # fmt: skip
        return _Cut(made, at, why)

    return walk


def _pcapng() -> _Walk:
    """Blocks: type and length, and the length again at the end. A section states its byte order and its interfaces."""
    interfaces: list[Interface] = []
    order = "<"
    section: list[int] = []  # its interfaces by number
    seen = 0  # sections and interfaces

    def walk(octets: Octets, begin: int, n: int) -> _Cut:
        nonlocal order, seen
        runs, at, why = _Runs(octets, n, 0, 8), 0, ""
        # interfaces of all sections; and of each state of a section its first one, how many they are, and the order
        listed = list(section)
        states = [(0, len(listed), order == ">")]
        while at + _BLOCK_BYTES <= n:
            kind, size = struct.unpack_from(order + "2I", octets.data, at)
            if kind == _SECTION:
                stated = _BYTE_ORDER.get(octets[at + 8 : at + 12].tobytes())
                if stated is None:
                    why = "a section's header is damaged"
                    break
                order = stated
                size = struct.unpack_from(order + "I", octets.data, at + 4)[0]
                section.clear()
                states.append((len(listed), 0, order == ">"))
            if size < _BLOCK_BYTES or size % 4 or size > _MAX_BLOCK:
                why = "a block's length is damaged"
                break
            if at + size > n:
                break
            if kind == _INTERFACE:
                made = _interface(octets[at + 8 : at + size - 4].tobytes(), order, len(section))
                if made is None:
                    why = "a block is too short for an interface"
                    break
                section.append(len(interfaces))
                listed.append(len(interfaces))
                interfaces.append(made)
                states.append((len(listed) - len(section), len(section), order == ">"))
            single = kind in (_SECTION, _INTERFACE)
            seen += single
            if seen > _MAX_STATES:
                why = f"more than {_MAX_STATES:,} sections and interfaces"
                break
            at += size * (runs.take(at, size, len(states) - 1, single=single))
        starts, sizes, which = runs.records()
        first, count, _ = (column[which] for column in np.array(states, np.int64).T)
        big = np.array([each[2] for each in states])[which]
        bad = np.flatnonzero(_numbers(octets, starts + sizes - 4, big) != sizes)
        if bad.size:
            at, why = int(starts[bad[0]]), "a block's two lengths differ"
        good = slice(int(bad[0]) if bad.size else len(starts))
        kinds = _numbers(octets, starts, big)[good]
        rows = np.flatnonzero((kinds == _OLD_PACKET) | (kinds == _SIMPLE_PACKET) | (kinds == _PACKET))
        others = len(kinds) - len(rows) - int(((kinds == _SECTION) | (kinds == _INTERFACE)).sum())
        starts, sizes, first, count = (column[rows] for column in (starts, sizes, first, count))
        big = big[rows]
        old, timed = kinds[rows] == _OLD_PACKET, kinds[rows] != _SIMPLE_PACKET
        word, high, low, captured = (_numbers(octets, starts + k, big) for k in (8, 12, 16, 20))
        number = np.where(old, np.where(big, word >> 16, word & 0xFFFF), word) * timed
        there = (number < count) & (sizes >= np.where(timed, _BLOCK_BYTES + 20, _BLOCK_BYTES + 4))
        interface = np.zeros(len(rows), np.int64)
        interface[there] = np.array(listed, np.int64)[(first + number)[there]]
        longest = np.array([each.longest or _MAX_BLOCK for each in interfaces], np.int64)
        if there.any():
            captured = np.where(timed, captured, np.minimum(word, longest[interface]))
        packet = starts + np.where(timed, 28, 12)
        there &= packet + captured <= starts + sizes - 4
        ticks = (high.astype(np.uint64) << np.uint64(32) | low.astype(np.uint64)) * timed
        length = np.where(there, captured, -1)
        return _Cut(
            Packets(interfaces, octets, begin, packet, length, ticks, interface, timed, others, False),
            at,
            why,
        )

    return walk


class _Runs:
    """Where the records of a piece begin: one after the other, or many at once where one is as the next."""

    def __init__(self, octets: Octets, n: int, begin: int, end: int):
        """`begin`, `end`: of the bytes of a record by which those of a run are alike, its size among them."""
        self._octets, self._n, self._same = octets, n, slice(begin, end)
        self._runs: list[tuple[int, int, int, int]] = []
        self._trial, self._wait = _TRIAL, 0

    def take(self, at: int, size: int, state: int = 0, *, single: bool = False) -> int:
        """Take the record at `at`, and those behind it that are alike; returns how many they are."""
        k = 1
        if self._wait:
            self._wait -= 1
        elif not single:
            most = min(self._trial, (self._n - at) // size)
            rows = self._octets[at : at + most * size].reshape(most, size)[:, self._same]
            differs = (rows != rows[0]).any(axis=1)
            k = int(differs.argmax()) if differs.any() else most
            # where few are alike, trying costs more than it gives
            self._trial = 8 * self._trial if k == self._trial else _TRIAL
            self._wait = 0 if k >= _TRIAL // 2 else 4 * _TRIAL
        self._runs.append((at, size, k, state))
        return k

    def records(self) -> tuple[Whole, Whole, Whole]:
        """First byte, size and state of each record."""
        at, size, k, state = np.array(self._runs, np.int64).reshape(-1, 4).T
        before = np.repeat(np.cumsum(k) - k, k)
        size = np.repeat(size, k)
        return np.repeat(at, k) + (np.arange(len(size)) - before) * size, size, np.repeat(state, k)


def _numbers(octets: Octets, at: Whole, big: npt.NDArray[np.bool_]) -> Whole:
    """Whole numbers of 4 bytes, in either order."""
    words: Whole = octets[at].astype(np.int64)
    back = words << 24
    for k in (1, 2, 3):
        octet = octets[at + k].astype(np.int64)
        words |= octet << 8 * k
        back |= octet << 24 - 8 * k
    return np.where(big, back, words)


def _interface(body: bytes, order: str, number: int) -> Interface | None:
    """An interface's description, None where it is too short; options that do not fit it are left out."""
    if len(body) < 8:
        return None
    link, _, longest = struct.unpack_from(order + "2HI", body)
    made = Interface(link, order, "", number, 6, 0, longest)
    at = 8
    while at + 4 <= len(body):
        code, length = struct.unpack_from(order + "2H", body, at)
        value = body[at + 4 : at + 4 + length]
        if code == 0 or len(value) < length:
            break
        if code == _NAME:
            # as long as the names of other logs may be
            made = made._replace(name=value.rstrip(b"\0").decode("utf-8", "replace")[:255])
        elif code == _RESOLUTION and length == 1:
            made = made._replace(resolution=value[0])
        elif code == _OFFSET and length == 8:
            made = made._replace(offset=struct.unpack(order + "q", value)[0])
        at += 4 + length + -length % 4
    return made
