"""Messages of more than 8 bytes in packets: SAE J1939-21, transport protocol, broadcast (BAM) and to one node (RTS/CTS).

A listener hears both sides: a packet that comes out of turn ends a broadcast, and in a transfer to one node what follows is
left out until the receiver asks for the packets again. Nothing is filled in: a message is whole, or it is none.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

import numpy as np

from canid.signals.dbc_text.parsing import Message
from canid.signals.vehicle import j1939
from canid.signals.vehicle.bits import Rows
from canid.values.frame_columns import FD_BYTES, join, octets_of, select
from canid.values.types import Columns, Flag

# PDU formats of connection management and of data, of data page 0
_MANAGEMENT, _DATA = 0xEC, 0xEB
_ALL = 0xFF  # destination of a broadcast
# control bytes
_RTS, _CTS, _END, _BAM, _ABORT = 16, 17, 19, 32, 255
_PACKET_BYTES = 7
_MIN_BYTES, _MAX_BYTES = 9, 255 * _PACKET_BYTES
# s between packets: T1 of a broadcast; T2 of a transfer to one node, which waits for its receiver
_BROADCAST_TIMEOUT_S, _TIMEOUT_S = 0.75, 1.25
# Transfers that are followed at once: a truck has some 30 nodes, each with one broadcast and one transfer to each other.
_MAX_TRANSFERS = 1024
# of the id that a message is given: the default of J1939-21
_PRIORITY = 6
_NO_DATA = int(Flag.REMOTE | Flag.ERROR)


class Transfer(NamedTuple):
    """A message of which some packets have come."""

    group: int  # parameter group number
    size: int  # bytes
    received: int  # packets, all from the first on
    data: bytes  # the first 64, as many as a frame of CAN FD has
    t: float  # s, of the latest frame that belongs to it
    out_of_turn: bool = False  # packets are left out until the receiver asks for them again


# by bus, source and destination
Transfers = Mapping[tuple[int, int, int], Transfer]


class Assembled(NamedTuple):
    """Messages that became whole in a chunk."""

    row: Rows  # (m,) of the last packet of each
    frames: Columns  # (m,) the messages, as if each were one frame; of longer ones the first 64 bytes
    incomplete: Counter[int]  # by parameter group: messages of which a packet is missing


def groups_of(messages: Iterable[Message]) -> frozenset[int]:
    """The parameter groups that J1939 messages have."""
    return frozenset(j1939.pgn_of(message.id) for message in messages if message.protocol == j1939.PROTOCOL)


def step(open_: Transfers, chunk: Columns, groups: Collection[int]) -> tuple[Transfers, Assembled | None]:
    """Take the next frames.

    Args:
        open_: what the last step gave; {} at the beginning.
        chunk: frames.
        groups: parameter group numbers that are wanted.

    Returns:
        the next state, of at most 1,024 transfers; and what became whole or was lost, None: nothing.

    Example:
        >>> from canid.values.frame_columns import columns_of
        >>> from canid.values.types import Frame
        >>> words = "20 0a 00 02 ff e3 fe 00", "01 c0 12 00 00 00 00 00", "02 00 00 2a ff ff ff ff"
        >>> ids = 0x1CECFF00, 0x1CEBFF00, 0x1CEBFF00
        >>> frames = [Frame(0.05 * k, 0, ids[k], bytes.fromhex(words[k]), Flag.EXTENDED) for k in range(3)]
        >>> _, made = step({}, columns_of(frames), {0xFEE3})
        >>> made.row.tolist(), hex(made.frames.id[0]), made.frames.data[0, :10].tobytes().hex()
        ([2], '0x18fee300', 'c012000000000000002a')
    """
    if not groups:
        return open_, None
    page_and_format = chunk.id >> 16 & 0x3FF
    is_packet = (page_and_format == _MANAGEMENT) | (page_and_format == _DATA)
    rows = np.flatnonzero(is_packet & ((chunk.flags & (_NO_DATA | int(Flag.EXTENDED))) == int(Flag.EXTENDED)))
    if not rows.size:
        return open_, None
    transfers = dict(open_)
    incomplete: Counter[int] = Counter()
    whole: list[tuple[int, int, int, Transfer]] = []
    packets = select(chunk, rows)
    lists = (column.tolist() for column in (rows, packets.t, packets.bus, packets.id, packets.length))
    width = chunk.data.shape[1]
    octets = packets.data.tobytes()
    for k, (row, t, bus, id_, length) in enumerate(zip(*lists, strict=True)):
        data = octets[k * width : k * width + length]
        source, destination = id_ & 0xFF, id_ >> 8 & 0xFF
        if id_ >> 16 & 0xFF == _MANAGEMENT:
            _manage(transfers, (bus, source, destination), t, data, groups, incomplete)
            continue
        key = (bus, source, destination)
        transfer = transfers.get(key)
        if transfer is None or not data:
            continue
        after = _next(transfer, t, data, destination == _ALL)
        if after is None:
            incomplete[transfer.group] += 1
            del transfers[key]
        elif _PACKET_BYTES * after.received >= after.size:
            whole.append((row, bus, _message_id(after, source, destination), after))
            del transfers[key]
        else:
            transfers[key] = after
    if not whole and not incomplete:
        return transfers, None
    return transfers, Assembled(
        np.array([row for row, *_ in whole], np.int64), _frames(chunk, whole), incomplete
    )


def replaced(chunk: Columns, made: Assembled) -> Columns:
    """The chunk with each message in the place of its last packet."""
    if not made.row.size:
        return chunk
    rows = np.arange(len(chunk.t))
    rows[made.row] = len(rows) + np.arange(len(made.row))
    return select(join([chunk, made.frames]), rows)


def inserted(chunk: Columns, made: Assembled | None) -> Columns:
    """The chunk with each message behind its last packet."""
    if made is None or not made.row.size:
        return chunk
    after = np.concatenate([np.arange(len(chunk.t)), made.row])
    return select(join([chunk, made.frames]), np.argsort(after, kind="stable"))


def _manage(
    transfers: dict[tuple[int, int, int], Transfer],
    way: tuple[int, int, int],
    t: float,
    data: bytes,
    groups: Collection[int],
    incomplete: Counter[int],
) -> None:
    """Take a frame of connection management, which goes `way`: bus, source, destination."""
    if len(data) < 8:
        return
    control, group = data[0], _group(data)
    bus, source, destination = way
    if control in (_RTS, _BAM):
        # the sender begins anew, whether or not it had ended
        _drop(transfers, way, incomplete)
        size = data[1] | data[2] << 8
        fits = _MIN_BYTES <= size <= _MAX_BYTES and data[3] == -(-size // _PACKET_BYTES)
        if not fits or group not in groups or (control == _BAM) != (destination == _ALL):
            return
        if len(transfers) >= _MAX_TRANSFERS:
            _drop(transfers, next(iter(transfers)), incomplete)
        transfers[way] = Transfer(group, size, 0, b"", t)
        return
    back = bus, destination, source
    for each in (way, back) if control == _ABORT else (back,):
        transfer = transfers.get(each)
        if transfer is None or transfer.group != group:
            continue
        if control == _CTS and data[1] == 0 and t - transfer.t <= _TIMEOUT_S:  # it asks to wait
            transfers[each] = transfer._replace(t=t)
        elif control == _CTS and 1 <= data[2] <= transfer.received + 1 and t - transfer.t <= _TIMEOUT_S:
            received = data[2] - 1
            kept = transfer.data[: _PACKET_BYTES * received]
            transfers[each] = transfer._replace(received=received, data=kept, t=t, out_of_turn=False)
        elif control in (_CTS, _END, _ABORT):
            _drop(transfers, each, incomplete)


def _drop(
    transfers: dict[tuple[int, int, int], Transfer], way: tuple[int, int, int], incomplete: Counter[int]
) -> None:
    transfer = transfers.pop(way, None)
    if transfer is not None:
        incomplete[transfer.group] += 1


def _next(transfer: Transfer, t: float, data: bytes, broadcast: bool) -> Transfer | None:
    """The transfer after a packet; None: it is lost."""
    if abs(t - transfer.t) > (_BROADCAST_TIMEOUT_S if broadcast else _TIMEOUT_S):
        return None
    if transfer.out_of_turn or data[0] != transfer.received + 1:
        return None if broadcast else transfer._replace(t=t, out_of_turn=True)
    wanted = min(_PACKET_BYTES, transfer.size - _PACKET_BYTES * transfer.received)
    if len(data) <= wanted:
        return None
    kept = (transfer.data + data[1 : 1 + wanted])[:FD_BYTES]
    return transfer._replace(received=transfer.received + 1, data=kept, t=t)


def _group(data: bytes) -> int:
    """The parameter group in bytes 6 to 8 of connection management, without a destination."""
    return j1939.pgn_of(int.from_bytes(data[5:8], "little") << 8)


def _message_id(transfer: Transfer, source: int, destination: int) -> int:
    """The id that the message would have as one frame."""
    id_ = _PRIORITY << 26 | transfer.group << 8 | source
    # a group whose lower byte is a destination
    return id_ | destination << 8 if j1939.pgn_of(id_ | _ALL << 8) == transfer.group else id_


def _frames(chunk: Columns, whole: list[tuple[int, int, int, Transfer]]) -> Columns:
    return Columns(
        chunk.t[[row for row, *_ in whole]],
        np.array([bus for _, bus, *_ in whole], np.uint16),
        np.array([id_ for _, _, id_, _ in whole], np.uint32),
        np.full(len(whole), int(Flag.EXTENDED), np.uint8),
        np.array([len(transfer.data) for *_, transfer in whole], np.uint8),
        octets_of([transfer.data for *_, transfer in whole]),
    )
