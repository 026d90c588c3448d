"""The inner layer of a .blf: from a payload to columns.

Every size is checked before it is used. Objects that hold no CAN frame are counted by kind (`blf_object_kinds`).
A time of 2^63 ns or more is a negative one: `blf_writer` writes frames so that are stamped before the first because a
clock was set back.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.frame_columns import CLASSIC_BYTES, FD_BYTES, WantedIds
from canid.logs.blf import blf_consistency, blf_object_kinds
from canid.logs.blf import blf_layout as blf
from canid.logs.blf.blf_layout import MAX_INFLATED_BYTES, MAX_PADDING_BYTES, Data
from canid.logs.blf.blf_marker import GLOBAL_MARKER, MarkerEvent, decode
from canid.logs.blf.blf_object_chain import Broken, Chain, Ints, chain, signatures
from canid.logs.text_lines import MAX_TIME_NS
from canid.types import Array, Columns, Flag

_EXTENDED, _REMOTE, _ERROR, _TX = (int(f) for f in (Flag.EXTENDED, Flag.REMOTE, Flag.ERROR, Flag.TX))
_FD, _BRS, _ESI = (int(f) for f in (Flag.FD, Flag.BRS, Flag.ESI))
_HEADER_SIZE = {1: blf.OBJECT_V1_SIZE, 2: blf.OBJECT_V2_SIZE}
_VERSIONS = tuple(_HEADER_SIZE)
_HEADER_FIELDS = [
    ("signature", "<u4"), ("header_size", "<u2"), ("version", "<u2"), ("size", "<u4"), ("kind", "<u4"),
    ("unit", "<u4"), ("client", "<u2"), ("object_version", "<u2"), ("ns", "<i8"),
]  # fmt: skip
# as blf_layout.CLASSIC, ERROR_EXT, FD and FD64
_CLASSIC_BODY = [("channel", "<u2"), ("how", "u1"), ("dlc", "u1"), ("word", "<u4"), ("data", "<u8")]
_ERROR_BODY = [
    ("channel", "<u2"), ("length", "<u2"), ("flags", "<u4"), ("ecc", "u1"), ("position", "u1"), ("dlc", "u1"),
    ("pad", "u1"), ("frame_length", "<u4"), ("word", "<u4"), ("more", "<u2"), ("pad2", "<u2"), ("data", "<u8"),
]  # fmt: skip
_FD_BODY = [
    ("channel", "<u2"), ("how", "u1"), ("dlc", "u1"), ("word", "<u4"), ("frame_length", "<u4"), ("bits", "u1"),
    ("fd", "u1"), ("valid", "u1"), ("pad", "V5"), ("data", "u1", (64,)),
]  # fmt: skip
_FD64_BODY = [
    ("channel", "u1"), ("dlc", "u1"), ("valid", "u1"), ("tx_count", "u1"), ("word", "<u4"), ("frame_length", "<u4"),
    ("fd", "<u4"), ("rates", "<u4", (2,)), ("offsets", "<u4", (2,)), ("bits", "<u2"), ("sent", "u1"),
    ("extended_at", "u1"), ("crc", "<u4"),
]  # fmt: skip
_BODY: dict[int, list[Any]] = {
    blf.CAN_MESSAGE: _CLASSIC_BODY,
    blf.CAN_MESSAGE2: _CLASSIC_BODY,
    blf.CAN_ERROR_EXT: _ERROR_BODY,
    blf.CAN_FD_MESSAGE: _FD_BODY,
    blf.CAN_FD_MESSAGE_64: _FD64_BODY,
}


def _layout(body: list[Any], version: int) -> np.dtype[Any]:
    """The structure of an object's header and body; `top` is the highest byte of the id's word."""
    longer = _HEADER_SIZE[version] - blf.OBJECT_V1_SIZE
    plain = np.dtype(_HEADER_FIELDS + [("longer", f"V{longer}")] * bool(longer) + body)
    fields = {name: field[:2] for name, field in (plain.fields or {}).items()}
    fields["top"] = (np.dtype("u1"), fields["word"][1] + 3)
    return np.dtype(
        {
            "names": [*fields],
            "formats": [f[0] for f in fields.values()],
            "offsets": [f[1] for f in fields.values()],
            "itemsize": plain.itemsize,
        }
    )


_LAYOUTS = {
    (kind, version): _layout(body, version) for kind, body in _BODY.items() for version in _HEADER_SIZE
}
# masks of the first n of eight bytes, little-endian
_BYTE_MASKS = np.array([(1 << 8 * n) - 1 for n in range(9)], dtype=np.uint64)
_DLC_BYTES = np.array(blf.DLC_BYTES, dtype=np.uint8)
# ns: longer times are damage, and differences of shorter ones fit 64 bits
_MAX_NS = MAX_TIME_NS - 1


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
    contradiction: str = ""  # inconsistency in data without a checksum that could be read nevertheless


def first_object(data: Data) -> int:
    """After damage: where the first whole-looking object begins, -1 if none does.

    Its header must be plausible and, if it ends in these data, another object must follow.
    """
    if len(data) < blf.OBJECT.size:
        return -1
    begin, heads = signatures(data, 0)
    size = heads["size"].astype(np.int64)
    good = (size >= heads["header_size"]) & (size <= MAX_INFLATED_BYTES)
    good &= np.isin(heads["version"], _VERSIONS)
    good &= heads["header_size"] == np.where(heads["version"] == 1, blf.OBJECT_V1_SIZE, blf.OBJECT_V2_SIZE)
    end = begin + size
    follower = np.append(begin, len(data))[np.searchsorted(begin, end)]
    good &= (end + MAX_PADDING_BYTES >= len(data)) | (
        follower <= end + MAX_PADDING_BYTES - len(blf.SIGNATURE)
    )
    found = np.flatnonzero(good)
    return int(begin[found[0]]) if found.size else -1


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
    groups = _groups(data, links)
    frames = sum(len(group.items) for group in groups)
    if wanted is not None and first is not None:
        groups = [_only(group, wanted) for group in groups]
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
    notes, uncounted, kinds = _others(data, links) if frames < len(links.begin) else ([], 0, Counter())
    objects = len(links.begin) - len(notes) - uncounted
    contradiction = "" if checked else blf_consistency.contradiction(data, position, links)
    return Walked(
        Columns(t, *parts[2:]), frames, objects, kinds, notes, links.rest, first, links.begin, contradiction
    )


def _unfinished(data: Data, rest: int) -> None:
    """Check the size of the last, unfinished object, as far as it is there. Raises Broken."""
    if data.startswith(blf.SIGNATURE, rest) and rest + blf.OBJECT.size <= len(data):
        *_, size, kind = blf.OBJECT.unpack_from(data, rest)
        if not blf.is_plausible(kind, size):
            raise Broken(f"an object of type {kind} claims a size of {size} bytes")


def _others(data: Data, links: Chain) -> tuple[list[tuple[int, MarkerEvent]], int, Counter[str]]:
    """Our own events, with the number of frames before each; how many objects no header counts; all others' kinds."""
    notes = []
    frame = np.isin(links.kind, list(_BODY))
    for k in np.flatnonzero(links.kind == GLOBAL_MARKER).tolist():
        event = decode(data, int(links.begin[k]), int(links.size[k]))
        if event is not None:
            notes.append((k, event))
    before = np.cumsum(frame)
    kinds = blf_object_kinds.count(links.kind[~frame])
    if notes:
        kinds[blf_object_kinds.kind_of(GLOBAL_MARKER)] -= len(notes)
    uncounted = int((links.kind == blf.UNCOUNTED_TYPE).sum())
    return [(int(before[k]), event) for k, event in notes], uncounted, +kinds


class _Group(NamedTuple):
    """Frames of one kind and one header version."""

    kind: int
    rows: Ints | slice  # (m,) which objects of the payload
    begin: Ints  # (m,)
    items: npt.NDArray[Any]  # (m,) of a layout


class _Parts(NamedTuple):
    """Columns before their times are relative."""

    ns: Ints
    coarse: npt.NDArray[np.bool_]  # the time counts 10 µs
    bus: npt.NDArray[np.uint16]
    id: npt.NDArray[np.uint32]
    flags: npt.NDArray[np.uint8]
    length: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]


def _groups(data: Data, links: Chain) -> list[_Group]:
    """Group the frames among the objects, their sizes checked. Raises Broken."""
    if links.step:
        _, header_size, version, size, kind = blf.OBJECT.unpack_from(data, links.begin[0])
        if not blf.is_plausible(kind, size):
            raise Broken(f"an object of type {kind} claims a size of {size} bytes")
        if kind not in _BODY:
            return []
        layout = _LAYOUTS.get((kind, version))
        if layout is None or size < max(layout.itemsize, header_size):
            raise Broken("an object is too short for what it holds")
        items = np.ndarray((len(links.begin),), layout, data, int(links.begin[0]), (links.step,))
        return [_Group(kind, slice(None), links.begin, items)]
    groups = []
    if links.kind.size and not 0 < links.kind.min() <= links.kind.max() < blf.MAX_TYPE:
        raise Broken(f"an object has the type {links.kind.max() if links.kind.min() else 0}")
    for kind in _BODY:
        rows = np.flatnonzero(links.kind == kind)
        if not len(rows):
            continue
        begin, size = links.begin[rows], links.size[rows]
        if size.max() > blf.MAX_OBJECT_BYTES[kind]:
            raise Broken(f"an object of type {kind} claims a size of {size.max()} bytes")
        if size.min() < _LAYOUTS[kind, 1].itemsize:
            raise Broken("an object is too short for what it holds")
        heads = _items(data, begin, _LAYOUTS[kind, 1])
        versions = heads["version"]
        if (heads["header_size"] > size).any() or not np.isin(versions, _VERSIONS).all():
            raise Broken("an object is too short for what it holds")
        for version in _VERSIONS:
            layout, chosen = _LAYOUTS[kind, version], versions == version
            if (size[chosen] < layout.itemsize).any():
                raise Broken("an object is too short for what it holds")
            if chosen.any():
                items = heads[chosen] if version == 1 else _items(data, begin[chosen], layout)
                groups.append(_Group(kind, rows[chosen], begin[chosen], items))
    return groups


def _only(group: _Group, wanted: WantedIds) -> _Group:
    """Keep the frames that are wanted."""
    items = group.items
    rows = wanted.rows(items["word"])
    number = rows if isinstance(group.rows, slice) else group.rows[rows]
    # as plain bytes: numpy copies structures field by field
    chosen = items.view(f"V{items.dtype.itemsize}")[rows].view(items.dtype)
    return group._replace(rows=number, begin=group.begin[rows], items=chosen)


def _items(data: Data, begin: Ints, layout: np.dtype[Any]) -> npt.NDArray[Any]:
    """Copy the structures at `begin`, out of a view of overlapping ones: one for every byte."""
    size = layout.itemsize
    overlapping: npt.NDArray[Any] = np.ndarray((len(data) - size + 1,), f"V{size}", data, 0, (1,))
    return overlapping[begin].view(layout)


def _columns(data: Data, group: _Group, width: int) -> _Parts:
    items = group.items
    channel, word = items["channel"].astype(np.uint16), items["word"].astype(np.uint32)
    n = len(items)
    flags = items["top"] >> np.uint8(7)  # the word's highest bit; Flag.EXTENDED is 1
    remote: npt.NDArray[np.bool_] | None = None
    if group.kind in (blf.CAN_MESSAGE, blf.CAN_MESSAGE2):
        how, dlc = items["how"], items["dlc"]
        length = np.minimum(dlc, CLASSIC_BYTES)
        if how.any():
            flags |= (how & blf.TX) * np.uint8(_TX)
            remote = (how & blf.REMOTE) != 0
        payload = _eight(items["data"], length)
        asked = dlc
    elif group.kind == blf.CAN_ERROR_EXT:
        length = np.minimum(items["dlc"], CLASSIC_BYTES)
        payload = _eight(items["data"], length)
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


def _fd(data: Data, group: _Group) -> _FdParts:
    items = group.items
    valid, how, fd = items["valid"], items["how"], items["fd"]
    if valid.max(initial=0) > FD_BYTES:
        raise Broken(f"a CAN FD frame claims {valid.max()} bytes")
    payload = np.where(valid[:, np.newaxis] > _WITHIN, items["data"], np.uint8(0))
    kinds = ((fd & blf.FD_EDL) != 0, (fd & blf.FD_BRS) != 0, (fd & blf.FD_ESI) != 0)
    return valid, payload, (how & blf.TX) != 0, (how & blf.REMOTE) != 0, kinds


def _fd64(data: Data, group: _Group) -> _FdParts:
    items = group.items
    valid, fd, extended_at = items["valid"], items["fd"], items["extended_at"].astype(np.int64)
    size = items["size"].astype(np.int64)
    head = items.dtype.itemsize
    remote = (fd & blf.FD64_REMOTE) != 0
    space = np.where(extended_at > 0, extended_at, size) - head
    # a remote frame has no data, wherever they would end
    if valid.max(initial=0) > FD_BYTES or (~remote & ((space < 0) | (space > size - head))).any():
        raise Broken("a CAN FD frame's sizes do not agree")
    # CANoe logs fewer bytes than are valid where the rest is zero
    there = np.where(remote, 0, np.minimum(valid, space))
    body = np.ndarray((len(data) + 1,), f"V{FD_BYTES}", data + bytes(FD_BYTES), 0, (1,))[group.begin + head]
    payload = body.view(np.uint8).reshape(-1, FD_BYTES)
    payload = np.where(there[:, np.newaxis] > _WITHIN, payload, np.uint8(0))
    kinds = ((fd & blf.FD64_EDL) != 0, (fd & blf.FD64_BRS) != 0, (fd & blf.FD64_ESI) != 0)
    return valid, payload, items["sent"] != 0, remote, kinds


def _times(ns: Ints, coarse: npt.NDArray[np.bool_], first: int | None) -> tuple[Array, int | None]:
    """Seconds since the first frame, and that frame's ns. Raises Broken."""
    if not ns.size:
        return np.zeros(0), first
    scale = 10_000 if coarse.any() else 1
    # the numbers themselves leave 64 bits if they are coarse
    if max(int(ns.max()), -int(ns.min())) * scale > _MAX_NS and any(
        abs(int(x)) * (10_000 if ten else 1) > _MAX_NS for x, ten in zip(ns, coarse, strict=True)
    ):
        raise Broken("an object's time is a lifetime away")
    if scale > 1:
        ns = np.where(coarse, ns * scale, ns)
    begin = int(ns[0]) if first is None else first
    return (ns - begin).astype(np.float64) * 1e-9, begin
