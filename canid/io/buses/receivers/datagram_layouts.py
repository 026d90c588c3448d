"""Datagrams of python-can's udp_multicast by their layout: what differs between two of one layout is read as columns.

A datagram is a msgpack map with the fields of `can.Message`. Of those that one sender sends with one kind of frame only
the bytes of time stamp, id and data differ; all others are compared with a datagram that msgpack has unpacked, and what
differs anywhere else is unpacked by msgpack as well. Types from msgpack's specification (github.com/msgpack/msgpack).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.buses.frame_check import MAX_STAMP_NS, ImpossibleFrameError, largest_id, why_impossible
from canid.io.buses.receivers.received_columns import Many, ReceivedColumns, columns_of, select
from canid.io.buses.receivers.received_frame import Received
from canid.io.buses.receivers.udp_multicast import parse
from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES

# Layouts that are kept: a sender has one for each length of data, kind of frame and size of id (1, 2, 3 or 5 bytes).
MAX_LAYOUTS = 128
# datagrams of one size from which on comparing costs less than unpacking each
_FEW = 8
# bytes of what comes behind the types of numbers of a fixed size, the only ones that may differ
_UNSIGNED = {0xCC: 1, 0xCD: 2, 0xCE: 4}
_FLOAT_64, _BIN_8, _STR_8 = 0xCB, 0xC4, 0xD9

_BIG_ENDIAN = {1: ">u1", 2: ">u2", 4: ">u4"}

Octets = npt.NDArray[np.uint8]


class Layout(NamedTuple):
    """A datagram, and where others of its layout may differ from it."""

    words: npt.NDArray[np.uint64]  # the datagram, up to a multiple of 8 bytes
    compared: npt.NDArray[np.uint64]  # the bits in which others are the same
    frame: Received
    id_at: int
    id_bytes: int
    largest_id: int  # that such a frame can have
    data_at: int
    flags: npt.NDArray[np.uint8]  # (`most`,) of as many frames as one call can return, all the same
    length: npt.NDArray[np.uint8]  # as well


class _Places(NamedTuple):
    """First byte and number of bytes of the values that differ."""

    id: tuple[int, int]
    stamp: tuple[int, int]
    data: tuple[int, int]


def places(datagram: bytes) -> _Places | None:
    """Find the values that differ between datagrams of one layout; None where they have other types than python-can's.

    >>> import msgpack
    >>> places(msgpack.packb({"timestamp": 0.5, "arbitration_id": 0x123, "dlc": 2, "data": b"ab"}))
    _Places(id=(36, 2), stamp=(12, 8), data=(50, 2))
    """
    place = {"arbitration_id": (0, 0), "timestamp": (0, 0), "data": (0, 0)}
    if not datagram or datagram[0] & 0xF0 != 0x80:
        return None
    at, seen = 1, set[bytes]()
    try:
        for _ in range(datagram[0] & 0x0F):
            if datagram[at] & 0xE0 != 0xA0:
                return None
            end = at + 1 + (datagram[at] & 0x1F)
            name, at = datagram[at + 1 : end], end
            if name in seen:
                return None
            seen.add(name)
            kind = datagram[at]
            at += 1
            if kind < 0x80:  # a small number, in the byte of its type
                value = (at - 1, 1)
            elif kind & 0xE0 == 0xA0:
                value = (at, kind & 0x1F)
                at += value[1]
            elif kind in _UNSIGNED:
                value = (at, _UNSIGNED[kind])
                at += value[1]
            elif kind == _FLOAT_64:
                value = (at, 8)
                at += 8
            elif kind in (_BIN_8, _STR_8):
                value = (at + 1, datagram[at])
                at += 1 + value[1]
            elif kind in (0xC0, 0xC2, 0xC3):  # none, false, true
                value = (at - 1, 1)
            else:
                return None
            key = name.decode("ascii", "replace")
            wanted = {"timestamp": kind == _FLOAT_64, "data": kind == _BIN_8}
            wanted["arbitration_id"] = kind < 0x80 or kind in _UNSIGNED
            if key in place:
                if not wanted[key]:
                    return None
                place[key] = value
    except IndexError:
        return None
    if at != len(datagram) or not place["arbitration_id"][1]:
        return None
    return _Places(place["arbitration_id"], place["timestamp"], place["data"])


def layout_of(datagram: bytes, frame: Received, most: int) -> Layout | None:
    """The layout of a datagram that holds this frame; None where it has none. `most`: frames of one call."""
    place = places(datagram)
    if place is None or place.data[1] != len(frame.data):
        return None
    compared = np.full(len(datagram), 0xFF, np.uint8)
    for begin, count in place:
        compared[begin : begin + count] = 0
    (id_at, id_bytes) = place.id
    if id_bytes == 1 and datagram[id_at] < 0x80 and datagram[id_at - 1] not in _UNSIGNED:
        compared[id_at] = 0x80  # a larger number has another type
    size = -(-len(datagram) // 8) * 8
    padded = np.zeros((2, size), np.uint8)
    padded[0, : len(datagram)] = np.frombuffer(datagram, np.uint8)
    padded[1, : len(datagram)] = compared
    words = padded.view(np.uint64)
    flags = np.full(most, frame.flags, np.uint8)
    length = np.full(most, max(frame.length, len(frame.data)), np.uint8)
    largest = largest_id(frame.flags)
    return Layout(
        words[0] & words[1], words[1], frame, id_at, id_bytes, largest, place.data[0], flags, length
    )


class DatagramReader:
    """Datagrams as columns; remembers the layouts that came."""

    def __init__(self, unpack: Callable[[bytes], Any], most: int):
        """`unpack`: msgpack's; `most`: datagrams of one call."""
        self._unpack = unpack
        self._most = most
        self._layouts: dict[int, list[Layout]] = {}  # by the datagram's size
        self._count = 0

    def read(
        self,
        octets: Octets,
        lengths: npt.NDArray[Any],
        ns: npt.NDArray[np.int64],
        whole: Callable[[int], bytes],
    ) -> Many:
        """Read n datagrams.

        Args:
            octets: (n, width) their beginnings; width a multiple of 8.
            lengths: (n,) bytes of each.
            ns: (n,) when they were received.
            whole: a datagram, by its row.
        """
        n = len(octets)
        alike = self._read_all(octets, lengths, ns)
        if alike is not None:
            return alike
        frames = ReceivedColumns(
            ns.copy(),
            np.zeros(n, np.uint32),
            np.zeros(n, np.uint8),
            np.zeros(n, np.uint8),
            np.zeros((n, FD_BYTES), np.uint8),
        )
        single: list[npt.NDArray[np.int64]] = []
        for size in sorted(set(lengths.tolist())):  # np.unique would import numpy.ma, 60 ms
            rows = np.flatnonzero(lengths == size)
            if size > octets.shape[1] or len(rows) <= _FEW:
                single.append(rows)
                continue
            single.append(self._read_alike(octets, size, rows, frames, whole))
        impossible: list[tuple[str, int]] = []
        good = np.ones(n, bool)
        for row in np.sort(np.concatenate(single)).tolist() if single else ():
            got = self._single(whole(row), int(ns[row]))
            if isinstance(got, Received):
                _put(frames, row, got)
            else:
                good[row] = False
                impossible.append(got)
        width = FD_BYTES if n and frames.length.max() > CLASSIC_BYTES else CLASSIC_BYTES
        frames = frames._replace(data=frames.data[:, :width])
        if impossible:
            frames = select(frames, good)
        return Many(frames, impossible)

    def _read_all(self, octets: Octets, lengths: npt.NDArray[Any], ns: npt.NDArray[np.int64]) -> Many | None:
        """Read datagrams that have all one layout, which came before; None: they have not."""
        size = int(lengths[0])
        layouts = self._layouts.get(size)
        if layouts is None or not (lengths == size).all():
            return None
        words = octets[:, : -(-size // 8) * 8].view(np.uint64)
        for layout in layouts:
            if ((words & layout.compared) == layout.words).all():
                n, id_ = len(octets), _ids(octets, layout)
                frames = ReceivedColumns(ns, id_, layout.flags[:n], layout.length[:n], _data(octets, layout))
                return Many(
                    frames, checked=int(id_.max()) <= layout.largest_id and bool(ns.max() <= MAX_STAMP_NS)
                )
        return None

    def _single(self, datagram: bytes, ns: int) -> Received | tuple[str, int]:
        """A datagram by itself; why it holds no frame that a bus can carry, and when it came."""
        try:
            fields = self._unpack(datagram)
        except Exception:  # msgpack's own kinds, and what its unpacker raises besides
            return "a datagram that is no frame", ns
        try:
            frame = parse(fields, ns)
        except ImpossibleFrameError as error:
            return str(error), ns
        why = why_impossible(frame)
        return (why, ns) if why else frame

    def _read_alike(
        self,
        octets: Octets,
        size: int,
        rows: npt.NDArray[np.int64],
        frames: ReceivedColumns,
        whole: Callable[[int], bytes],
    ) -> npt.NDArray[np.int64]:
        """Read datagrams of one size by their layouts; returns those that have to be read by themselves."""
        words = octets[rows, : -(-size // 8) * 8].view(np.uint64)
        for layout in self._layouts.get(size, ()):
            same = ((words & layout.compared) == layout.words).all(axis=1)
            if same.any():
                _read_rows(octets, rows[same], layout, frames)
                rows, words = rows[~same], words[~same]
                if not rows.size:
                    return rows
        single: list[int] = []
        while len(rows) > _FEW:
            datagram = whole(int(rows[0]))
            got = self._single(datagram, 0)
            new_layout = layout_of(datagram, got, self._most) if isinstance(got, Received) else None
            if new_layout is None:
                single.append(int(rows[0]))
                rows, words = rows[1:], words[1:]
                continue
            self._keep(size, new_layout)
            same = ((words & new_layout.compared) == new_layout.words).all(axis=1)
            _read_rows(octets, rows[same], new_layout, frames)
            rows, words = rows[~same], words[~same]
        return np.concatenate([rows, np.array(single, np.int64)])

    def _keep(self, size: int, layout: Layout) -> None:
        if self._count >= MAX_LAYOUTS:
            self._layouts.clear()
            self._count = 0
        self._layouts.setdefault(size, []).append(layout)
        self._count += 1


def _read_rows(octets: Octets, rows: npt.NDArray[np.int64], layout: Layout, frames: ReceivedColumns) -> None:
    """Read datagrams of one layout into their rows."""
    alike = octets[rows]
    data = _data(alike, layout)
    frames.id[rows] = _ids(alike, layout)
    frames.flags[rows] = layout.frame.flags
    frames.length[rows] = layout.length[0]
    frames.data[rows, : data.shape[1]] = data


def _ids(octets: Octets, layout: Layout) -> npt.NDArray[np.uint32]:
    """The ids of datagrams of one layout."""
    part = octets[:, layout.id_at : layout.id_at + layout.id_bytes]
    return (
        np.ascontiguousarray(part).view(_BIG_ENDIAN[layout.id_bytes]).reshape(len(octets)).astype(np.uint32)
    )


def _data(octets: Octets, layout: Layout) -> Octets:
    """The data of datagrams of one layout, as wide as columns are."""
    size = len(layout.frame.data)
    data = np.zeros((len(octets), CLASSIC_BYTES if size <= CLASSIC_BYTES else FD_BYTES), np.uint8)
    data[:, :size] = octets[:, layout.data_at : layout.data_at + size]
    return data


def _put(frames: ReceivedColumns, row: int, got: Received) -> None:
    columns = columns_of([got])
    frames.id[row], frames.flags[row], frames.length[row] = columns.id[0], columns.flags[0], columns.length[0]
    frames.data[row, : columns.data.shape[1]] = columns.data[0]
