"""The inner layer of a .blf: from a payload to columns.

The frames are parted into groups of one layout (`blf_groups`); objects that hold no CAN frame are counted by kind
(`blf_object_kinds`).
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.blf import blf_consistency, blf_object_kinds
from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_dtypes import BODY, VERSIONS
from canid.io.logs.blf.blf_groups import (
    WRONG,
    Group,
    groups_of,
    last_time,
    only,
    sound,
    without_requests,
)  # fmt: skip
from canid.io.logs.blf.blf_layout import MAX_INFLATED_BYTES, MAX_PADDING_BYTES, Data
from canid.io.logs.blf.blf_marker import GLOBAL_MARKER, MarkerEvent, decode
from canid.io.logs.blf.blf_object_chain import Broken, Chain, Ints, chain, signatures
from canid.values.frame_columns import CLASSIC_BYTES, DLC_BYTES, FD_BYTES, WantedIds
from canid.values.types import Array, Columns, Flag

_EXTENDED, _REMOTE, _ERROR, _TX = (int(f) for f in (Flag.EXTENDED, Flag.REMOTE, Flag.ERROR, Flag.TX))
_FD, _BRS, _ESI = (int(f) for f in (Flag.FD, Flag.BRS, Flag.ESI))
# masks of the first n of eight bytes, little-endian
_BYTE_MASKS = np.array([(1 << 8 * n) - 1 for n in range(9)], dtype=np.uint64)
_DLC_BYTES = np.array(DLC_BYTES, dtype=np.uint8)


class Walked(NamedTuple):
    """The contents of a payload."""

    frames: Columns
    frames_read: int  # all of them, wanted or not
    objects: int  # what a file header counts: frames and objects of other types, but not our own events
    kinds: Counter[str]  # objects that hold no CAN frame
    notes: list[tuple[int, MarkerEvent]]  # our own events, and how many of the frames stand before each
    rest: int  # where the unfinished last object begins
    first: int | None  # ns of the log's first frame, once there was one
    begin: Ints  # (n,) where the whole objects begin
    wrong: int = 0  # frames that were left out: a number is none that its field can hold
    contradiction: str = ""  # inconsistency in data without a checksum that could be read nevertheless
    last: int | None = None  # ns of the last frame, wanted or not


def first_object(data: Data) -> int:
    """After damage: where the first whole-looking object begins, -1 if none does.

    Its header must be plausible and, if it ends in these data, another object must follow.
    """
    if len(data) < blf.OBJECT.size:
        return -1
    begin, heads = signatures(data, 0)
    size = heads["size"].astype(np.int64)
    good = (size >= heads["header_size"]) & (size <= MAX_INFLATED_BYTES)
    good &= np.isin(heads["version"], VERSIONS)
    good &= heads["header_size"] == np.where(heads["version"] == 1, blf.OBJECT_V1_SIZE, blf.OBJECT_V2_SIZE)
    end = begin + size
    follower = np.append(begin, len(data))[np.searchsorted(begin, end)]
    good &= (end + MAX_PADDING_BYTES >= len(data)) | (
        follower <= end + MAX_PADDING_BYTES - len(blf.SIGNATURE)
    )
    good_rows = np.flatnonzero(good)
    return int(begin[good_rows[0]]) if good_rows.size else -1


def walk(
    data: Data, position: int, first: int | None, wanted: WantedIds | None = None, *, checked: bool = True
) -> Walked:
    """All whole objects of `data` from byte `position`.

    `first`: ns that times are relative to, None if no frame came yet. `wanted`: frames with other ids may be left
    out, but for the log's first. `checked`: a checksum confirms the data; else the objects are checked for
    consistency. Raises Broken.
    """
    links = chain(data, position)
    _unfinished(data, links.rest)
    groups, wrong = sound(groups_of(data, links), checked=checked)
    if wrong and not checked:
        raise Broken(WRONG)
    groups, requests = without_requests(groups)
    frames = sum(len(group.items) for group in groups)
    last = last_time(groups)
    if wanted is not None and first is not None:
        groups = [only(group, wanted) for group in groups]
    n = sum(len(group.items) for group in groups)
    wide = any(group.kind in (blf.CAN_FD_MESSAGE, blf.CAN_FD_MESSAGE_64) for group in groups)
    width = FD_BYTES if wide else CLASSIC_BYTES
    if len(groups) == 1:
        # all frames alike, the usual log: the group's columns are the payload's
        parts = _columns(data, groups[0], width)
    else:
        # frames are numbered in the order of the payload, objects of other types left out
        rank = np.zeros(len(links.begin), dtype=np.int64)
        for group in groups:
            rank[group.rows] = 1
        rank = np.cumsum(rank) - 1
        parts = _Parts(
            np.empty(n, np.int64), np.empty(n, bool), np.empty(n, np.uint16), np.empty(n, np.uint32),
            np.empty(n, np.uint8), np.empty(n, np.uint8), np.empty((n, width), np.uint8),
        )  # fmt: skip
        for group in groups:
            rows = rank[group.rows]
            into: tuple[npt.NDArray[Any], ...] = parts
            for whole, part in zip(into, _columns(data, group, width), strict=True):
                whole[rows] = part
    t, first = _times(parts.ns, parts.coarse, first)
    notes, uncounted, kinds = (
        _others(data, links, requests) if frames + wrong < len(links.begin) else ([], 0, Counter())
    )
    objects = len(links.begin) - len(notes) - uncounted - wrong
    contradiction = "" if checked else blf_consistency.contradiction(data, position, links)
    return Walked(
        Columns(t, *parts[2:]),
        frames,
        objects,
        kinds,
        notes,
        links.rest,
        first,
        links.begin,
        wrong,
        contradiction,
        last,
    )


def _unfinished(data: Data, rest: int) -> None:
    """Check the size of the last, unfinished object, as far as it is there. Raises Broken."""
    if data.startswith(blf.SIGNATURE, rest) and rest + blf.OBJECT.size <= len(data):
        *_, size, kind = blf.OBJECT.unpack_from(data, rest)
        if not blf.is_plausible(kind, size):
            raise Broken(f"an object of type {kind} claims a size of {size} bytes")


def _others(
    data: Data, links: Chain, requests: Ints
) -> tuple[list[tuple[int, MarkerEvent]], int, Counter[str]]:
    """Our own events, with the number of frames before each; how many objects no header counts; all others' kinds."""
    notes = []
    frame = np.isin(links.kind, list(BODY))
    for k in np.flatnonzero(links.kind == GLOBAL_MARKER).tolist():
        event = decode(data, int(links.begin[k]), int(links.size[k]))
        if event is not None:
            notes.append((k, event))
    kinds = blf_object_kinds.count(links.kind[~frame])
    if len(requests):
        kinds[blf_object_kinds.REQUESTS] += len(requests)
        frame[requests] = False
    before = np.cumsum(frame)
    if notes:
        kinds[blf_object_kinds.kind_of(GLOBAL_MARKER)] -= len(notes)
    uncounted = int((links.kind == blf.UNCOUNTED_TYPE).sum())
    return [(int(before[k]), event) for k, event in notes], uncounted, +kinds


class _Parts(NamedTuple):
    """Columns before their times are relative."""

    ns: Ints
    coarse: npt.NDArray[np.bool_]  # the time counts 10 µs
    bus: npt.NDArray[np.uint16]
    id: npt.NDArray[np.uint32]
    flags: npt.NDArray[np.uint8]
    length: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]


def _columns(data: Data, group: Group, width: int) -> _Parts:
    items = group.items
    channel, word = items["channel"].astype(np.uint16), items["word"].astype(np.uint32)
    n = len(items)
    flags = items["top"] >> np.uint8(7)  # the word's highest bit; Flag.EXTENDED is 1
    remote: npt.NDArray[np.bool_] | None = None
    if group.kind in (blf.CAN_MESSAGE, blf.CAN_MESSAGE2):
        how = items["how"]
        length = np.minimum(items["dlc"], CLASSIC_BYTES)
        if how.any():
            flags |= (how & blf.TX) * np.uint8(_TX)
            remote = (how & blf.REMOTE) != 0
        payload = _eight(items["data"], length)
        asked = length
    elif group.kind in blf.ERRORS:
        # only that of type 73 has data of a frame
        has_data = group.kind == blf.CAN_ERROR_EXT
        length = np.minimum(items["dlc"], CLASSIC_BYTES if has_data else 0).astype(np.uint8)
        payload = _eight(items["data"], length) if has_data else np.zeros((n, CLASSIC_BYTES), np.uint8)
        flags |= np.uint8(_ERROR)
        asked = length
    else:
        length, payload, sent, remote, kinds = (_fd if group.kind == blf.CAN_FD_MESSAGE else _fd64)(
            data, group
        )
        flags |= sent * np.uint8(_TX)
        for present, flag in zip(kinds, (_FD, _BRS, _ESI), strict=True):
            flags |= present * np.uint8(flag)
        asked = _DLC_BYTES[np.minimum(items["dlc"], 15)]
    if remote is not None and remote.any():
        flags |= remote * np.uint8(_REMOTE)
        length = np.where(remote, asked, length)
        payload = np.where(remote[:, np.newaxis], np.uint8(0), payload)
    if payload.shape[1] < width:
        padded = np.zeros((n, width), np.uint8)
        padded[:, : payload.shape[1]] = payload
        payload = padded
    return _Parts(
        ns=items["ns"].astype(np.int64),
        coarse=items["unit"] == blf.TEN_MICROSECONDS,
        bus=np.maximum(channel, 1) - np.uint16(1),
        id=word & np.uint32(blf.ID_MASK),
        flags=flags,
        length=length,
        data=payload,
    )


def _eight(words: npt.NDArray[np.uint64], length: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Bytes of eight-byte words, zero from `length` on."""
    if length.size and length.min() < CLASSIC_BYTES:
        words = words & _BYTE_MASKS[length]
    return np.ascontiguousarray(words, dtype="<u8").view(np.uint8).reshape(-1, CLASSIC_BYTES)


_Bools = npt.NDArray[np.bool_]
_FdParts = tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8], _Bools, _Bools, tuple[_Bools, _Bools, _Bools]]
_WITHIN = np.arange(FD_BYTES)


def _fd(data: Data, group: Group) -> _FdParts:
    items = group.items
    valid, how, fd = items["valid"], items["how"], items["fd"]
    payload = np.where(valid[:, np.newaxis] > _WITHIN, items["data"], np.uint8(0))
    kinds = ((fd & blf.FD_EDL) != 0, (fd & blf.FD_BRS) != 0, (fd & blf.FD_ESI) != 0)
    return valid, payload, (how & blf.TX) != 0, (how & blf.REMOTE) != 0, kinds


def _fd64(data: Data, group: Group) -> _FdParts:
    items = group.items
    valid, fd, extended_at = items["valid"], items["fd"], items["extended_at"].astype(np.int64)
    size = items["size"].astype(np.int64)
    head = items.dtype.itemsize
    remote = (fd & blf.FD64_REMOTE) != 0
    space = np.where(extended_at > 0, extended_at, size) - head
    # a remote frame has no data, wherever they would end
    if (~remote & ((space < 0) | (space > size - head))).any():
        raise Broken("a CAN FD frame's sizes do not agree")
    # CANoe logs fewer bytes than are valid where the rest is zero
    there = np.where(remote, 0, np.minimum(valid, space))
    body = np.ndarray((len(data) + 1,), f"V{FD_BYTES}", data + bytes(FD_BYTES), 0, (1,))[group.begin + head]
    payload = body.view(np.uint8).reshape(-1, FD_BYTES)
    payload = np.where(there[:, np.newaxis] > _WITHIN, payload, np.uint8(0))
    kinds = ((fd & blf.FD64_EDL) != 0, (fd & blf.FD64_BRS) != 0, (fd & blf.FD64_ESI) != 0)
    return valid, payload, items["sent"] != 0, remote, kinds


def _times(ns: Ints, coarse: npt.NDArray[np.bool_], first: int | None) -> tuple[Array, int | None]:
    """Seconds since the first frame, and that frame's ns."""
    if not ns.size:
        return np.zeros(0), first
    if coarse.any():
        ns = np.where(coarse, ns * np.where(coarse, 10_000, 1), ns)
    begin = int(ns[0]) if first is None else first
    return (ns - begin).astype(np.float64) * 1e-9, begin
