"""Frames as objects of a .blf, whole columns at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_dtypes import LAYOUTS
from canid.io.logs.own_times import check_own_times
from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES, select
from canid.values.types import Columns, Flag

_ERROR, _FD, _EXTENDED = int(Flag.ERROR), int(Flag.FD), int(Flag.EXTENDED)
_REMOTE, _TX, _BRS, _ESI = int(Flag.REMOTE), int(Flag.TX), int(Flag.BRS), int(Flag.ESI)
# a channel is its bus plus one, in two bytes
_MAX_BUS = 0xFFFE
# DLC codes of all lengths; beyond 64 there is none
_DLC = np.array([blf.dlc_of(length) for length in range(FD_BYTES + 1)], np.uint8)

# of all combinations of flags: their bits in the fields of an object
_FLAGS = np.arange(256)
_HOW = (np.where(_FLAGS & _TX, blf.TX, 0) | np.where(_FLAGS & _REMOTE, blf.REMOTE, 0)).astype(np.uint8)
_FD_FLAGS = np.where(_FLAGS & _BRS, blf.FD_BRS, 0) | np.where(_FLAGS & _ESI, blf.FD_ESI, 0)
_FD_FLAGS = (blf.FD_EDL | _FD_FLAGS).astype(np.uint8)


class Encoded(NamedTuple):
    """Objects one behind the other."""

    octets: npt.NDArray[np.uint8]
    ends: npt.NDArray[np.int64]  # (n,) of each object


def encode(chunk: Columns, stamps: npt.NDArray[np.int64]) -> Encoded:
    """Encode frames as objects.

    Of an error frame the id, the extended flag and eight data bytes are kept.

    Args:
        chunk: n frames.
        stamps: (n,) ns since the file's start.

    Raises:
        ValueError: a time before the file's start, more data than such a frame can carry, or a bus that has no channel.

    >>> from canid.values.frame_columns import columns_of
    >>> from canid.values.types import Frame
    >>> chunk = columns_of([Frame(0.0, 0, 0x123, b"abc"), Frame(0.0, 0, 0x123, b"abc", Flag.FD)])
    >>> encode(chunk, np.zeros(2, np.int64)).ends.tolist()
    [48, 164]
    """
    flags = chunk.flags
    _check(chunk)
    check_own_times(stamps)
    error, fd = (flags & _ERROR) != 0, (flags & (_FD | _ERROR)) == _FD
    classic = ~(error | fd)
    if classic.all():
        objects = _objects(blf.CAN_MESSAGE, chunk, stamps)
        return Encoded(objects.reshape(-1), np.arange(1, len(flags) + 1) * objects.shape[1])
    kinds = ((blf.CAN_MESSAGE, classic), (blf.CAN_FD_MESSAGE, fd), (blf.CAN_ERROR_EXT, error))
    ends = np.cumsum(np.select([rows for _, rows in kinds], [LAYOUTS[kind, 1].itemsize for kind, _ in kinds]))
    octets = np.empty(int(ends[-1]), np.uint8)
    for kind, wanted in kinds:
        rows = np.flatnonzero(wanted)
        size = LAYOUTS[kind, 1].itemsize
        octets[(ends[rows] - size)[:, None] + np.arange(size)] = _objects(
            kind, select(chunk, rows), stamps[rows]
        )
    return Encoded(octets, ends)


def _check(chunk: Columns) -> None:
    flags, length = chunk.flags, chunk.length
    longest = np.where(flags & _FD, FD_BYTES, CLASSIC_BYTES)
    wrong = (length > longest) & ((flags & _REMOTE) == 0)
    if wrong.any():
        worst = int(length[wrong].max())
        raise ValueError(f"a frame of {worst} bytes: classic CAN carries 8, CAN FD carries 64")
    if ((length > FD_BYTES) & ((flags & _FD) != 0)).any():
        raise ValueError("a remote frame that asks for more than 64 bytes")
    if chunk.bus.max() > _MAX_BUS:
        raise ValueError(f"bus {int(chunk.bus.max())}: a channel has two bytes")


def _objects(kind: int, chunk: Columns, stamps: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
    """Objects of one type: (n, size) bytes."""
    layout, flags, length = LAYOUTS[kind, 1], chunk.flags, chunk.length
    size = layout.itemsize
    head = blf.OBJECT.pack(blf.SIGNATURE, blf.OBJECT_V1_SIZE, 1, size, kind)
    head += blf.STAMP.pack(blf.ONE_NANOSECOND, 0, 0, 0)
    objects = np.empty((len(stamps), size), np.uint8)
    objects[:] = np.frombuffer(head.ljust(size, b"\0"), np.uint8)
    fields = objects.reshape(-1).view(layout)
    fields["ns"] = stamps
    fields["channel"] = chunk.bus + 1
    fields["word"] = chunk.id | np.where(flags & _EXTENDED, np.uint32(blf.ID_EXTENDED), np.uint32(0))
    data, at = layout.fields["data"][:2]  # type: ignore[index]  # it has fields
    width = min(chunk.data.shape[1], data.itemsize)
    objects[:, at : at + width] = chunk.data[:, :width]
    held = np.where(flags & _REMOTE, np.uint8(0), length)
    if kind == blf.CAN_ERROR_EXT:
        fields["dlc"] = np.minimum(held, CLASSIC_BYTES)
        return objects
    fields["how"] = _HOW[flags]
    fields["dlc"] = length if kind == blf.CAN_MESSAGE else _DLC[length]
    if kind == blf.CAN_FD_MESSAGE:
        fields["fd"], fields["valid"] = _FD_FLAGS[flags], held
    return objects
