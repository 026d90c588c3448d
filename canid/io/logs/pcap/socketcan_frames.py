"""Frames of SocketCAN in packets of a capture: linux/can.h, as link type 227 and in Linux's cooked captures (113, 276)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.pcap.capture_packets import Interface, Octets, Packets, Whole, nanoseconds
from canid.io.logs.text_lines import MAX_TIME_NS
from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES, MAX_STANDARD_ID
from canid.values.types import Columns, Flag

SOCKETCAN, SLL, SLL2 = 227, 113, 276
# bytes before the frame
_HEADER = {SOCKETCAN: 0, SLL: 16, SLL2: 20}
# of a cooked capture: ETH_P_CAN, ETH_P_CANFD, ETH_P_CANXL, and the kind of packet that this computer sent
_CAN, _CAN_FD, _CAN_XL, _SENT = 0x0C, 0x0D, 0x0E, 4
# link type 227 has no protocol: a frame says itself which it is
_ANY = -1
_FRAME_HEAD = 8  # id, length, flags, two bytes more
# of can_id
_EXTENDED, _REMOTE, _ERROR, _ID = 1 << 31, 1 << 30, 1 << 29, (1 << 29) - 1
# of the byte behind the length; and the bit of the length's byte that only CAN XL sets
_BRS, _ESI, _FDF, _XL = 1, 2, 4, 0x80

# what names a bus: an interface by its name or its number, of SLL2 the interface's index in the computer
Source = tuple[str, int]
NO_NAME: Source = ("", 0)


class Frames(NamedTuple):
    """The frames of a batch."""

    ns: Whole  # (n,) since 1970; 0: not stated
    columns: Columns  # with t of 0
    others: Counter[str]
    wrong: list[tuple[int, int, str]]  # first and last byte of the file of a packet that is damaged, and why


class _Heads(NamedTuple):
    """Of each packet of a batch."""

    protocol: Whole
    begin: Whole  # of the frame
    room: Whole  # bytes of it that were captured
    sent: npt.NDArray[np.bool_]
    big: npt.NDArray[np.bool_]  # whether the id is big-endian
    ifindex: Whole  # of the interface in the computer; 0: not stated


def sources(packets: Packets) -> set[Source]:
    """Which buses a batch has."""
    heads = _heads(packets)
    there = (heads.protocol == _ANY) | (heads.protocol == _CAN) | (heads.protocol == _CAN_FD)
    pairs = np.unique(_pairs(packets, heads)[there]).tolist()
    return {source_of(packets.interfaces[pair >> 32], pair & 0xFFFFFFFF) for pair in pairs}


def source_of(interface: Interface, index: int) -> Source:
    """What names the bus of a packet.

    Example:
        >>> source_of(Interface(227, "<", "can0", 2, 9), 0), source_of(Interface(276, "<", "any", 0, 6), 5)
        (('can0', 0), ('', 5))
    """
    if index:
        return "", index
    return (interface.name, 0) if interface.name else ("", -interface.number)


def frames(packets: Packets, buses: Mapping[Source, int]) -> Frames:
    """Take the frames out; `buses`: the number of each."""
    octets, heads, ns = packets.octets, _heads(packets), nanoseconds(packets)
    bus = _buses(packets, heads, buses)
    begin = heads.begin
    first = octets[begin[:, None] + np.arange(_FRAME_HEAD)]
    big = first[:, :4].copy().view(">u4")[:, 0].astype(np.int64)
    can_id = np.where(heads.big, big, first[:, :4].copy().view("<u4")[:, 0])
    length, bits = first[:, 4].astype(np.int64), first[:, 5]
    is_can = (heads.protocol == _ANY) | (heads.protocol == _CAN) | (heads.protocol == _CAN_FD)
    is_xl = (heads.protocol == _CAN_XL) | (
        (heads.protocol == _ANY) & (heads.room >= _FRAME_HEAD) & (length & _XL != 0)
    )
    is_can &= ~is_xl
    fd = is_can & ((heads.protocol == _CAN_FD) | (bits & _FDF != 0) | (length > CLASSIC_BYTES))
    # before Linux 5.14 a frame of CAN FD has no mark but its size
    fd |= is_can & (heads.room == _FRAME_HEAD + FD_BYTES)
    error, remote = can_id & _ERROR != 0, can_id & _REMOTE != 0
    remote &= ~error
    extended = (can_id & _EXTENDED != 0) & ~error
    id_ = can_id & _ID
    good = is_can | (packets.length < 0)
    wrong: list[tuple[int, int, str]] = []
    for why, rows in (
        ("a packet's block is damaged", packets.length < 0),
        ("a packet is shorter than the head of a frame", heads.room < _FRAME_HEAD),
        ("more than 64 data bytes", length > FD_BYTES),
        ("a remote frame of CAN FD", fd & remote),
        ("an id is too large", ~extended & ~error & (id_ > MAX_STANDARD_ID)),
        ("a packet was captured without all of its data", ~remote & (heads.room < _FRAME_HEAD + length)),
        ("its time is damaged", (ns < 0) | (ns > MAX_TIME_NS)),
        ("it is of another interface than the first 65,535", bus < 0),
    ):
        at = np.flatnonzero(good & rows)
        good[at] = False
        spans = zip(packets.at[at].tolist(), packets.length[at].tolist(), strict=True)
        wrong += [(packets.begin + place, packets.begin + place + max(size, 1), why) for place, size in spans]
    kept = np.flatnonzero(good)
    flags = extended * int(Flag.EXTENDED) | remote * int(Flag.REMOTE) | error * int(Flag.ERROR)
    flags |= fd * int(Flag.FD) | (fd & (bits & _BRS != 0)) * int(Flag.BRS) | heads.sent * int(Flag.TX)
    flags |= (fd & (bits & _ESI != 0)) * int(Flag.ESI)
    columns = Columns(
        np.zeros(len(kept)),
        bus[kept].astype(np.uint16),
        id_[kept].astype(np.uint32),
        flags[kept].astype(np.uint8),
        length[kept].astype(np.uint8),
        _data(octets, begin[kept] + _FRAME_HEAD, np.where(remote, 0, length)[kept]),
    )
    counts = {
        "CAN XL frames": int(is_xl.sum()),
        "packets of other protocols": int((~is_can & ~is_xl & (packets.length >= 0)).sum()),
        "blocks without packets": packets.others,
    }
    others = Counter({kind: n for kind, n in counts.items() if n})
    return Frames(ns[kept], columns, others, sorted(wrong))


def _heads(packets: Packets) -> _Heads:
    """What stands before each frame."""
    n = len(packets.at)
    octets, at, length = packets.octets, packets.at, packets.length
    protocol, index = np.zeros(n, np.int64), np.zeros(n, np.int64)
    begin, room = at.copy(), length.copy()
    sent, big = np.zeros(n, bool), np.ones(n, bool)
    for number in np.unique(packets.interface).tolist():
        interface = packets.interfaces[number]
        if interface.link not in _HEADER:
            continue
        size = _HEADER[interface.link]
        rows = np.flatnonzero((packets.interface == number) & (length >= size))
        begin[rows] += size
        room[rows] -= size
        if interface.link == SOCKETCAN:
            protocol[rows] = _ANY
            continue
        where = at[rows]
        big[rows] = interface.order == ">"
        if interface.link == SLL:
            protocol[rows] = _big_endian(octets, where + 14, 2)
            sent[rows] = _big_endian(octets, where, 2) == _SENT
        else:
            protocol[rows] = _big_endian(octets, where, 2)
            index[rows] = _big_endian(octets, where + 4, 4)
            sent[rows] = octets[where + 10] == _SENT
    return _Heads(protocol, begin, room, sent, big, index)


def _big_endian(octets: Octets, at: Whole, size: int) -> Whole:
    value = np.zeros(len(at), np.int64)
    for k in range(size):
        value = value << 8 | octets[at + k]
    return value


def _buses(packets: Packets, heads: _Heads, buses: Mapping[Source, int]) -> Whole:
    """The bus of each packet; -1: its source has no number."""
    pairs = _pairs(packets, heads)
    distinct = np.unique(pairs)
    numbers = [
        buses.get(source_of(packets.interfaces[pair >> 32], pair & 0xFFFFFFFF), -1)
        for pair in distinct.tolist()
    ]
    return np.array(numbers, np.int64)[np.searchsorted(distinct, pairs)]


def _pairs(packets: Packets, heads: _Heads) -> Whole:
    """Interface of the file and index in the computer of each packet, in one number."""
    pairs: Whole = packets.interface << 32 | heads.ifindex
    return pairs


def _data(octets: Octets, begin: Whole, length: Whole) -> Octets:
    """Data bytes, (n, 8) or (n, 64), zeros behind the last of each."""
    width = FD_BYTES if int(length.max(initial=0)) > CLASSIC_BYTES else CLASSIC_BYTES
    places = np.arange(width)
    data: Octets = octets[begin[:, None] + places]
    data[places >= length[:, None]] = 0
    return data
