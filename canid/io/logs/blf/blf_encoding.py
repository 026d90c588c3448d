"""Frames as objects of a .blf, whole columns at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.own_times import check_own_times
from canid.values.frame_columns import select
from canid.values.types import Columns, Flag

_ERROR, _FD, _EXTENDED = int(Flag.ERROR), int(Flag.FD), int(Flag.EXTENDED)
_REMOTE, _TX, _BRS, _ESI = int(Flag.REMOTE), int(Flag.TX), int(Flag.BRS), int(Flag.ESI)
CLASSIC_BYTES, FD_BYTES = 8, 64
# a channel is its bus plus one, in two bytes
_MAX_BUS = 0xFFFE
# DLC codes of all lengths; beyond 64 there is none
_DLC = np.array([blf.dlc_of(length) for length in range(FD_BYTES + 1)], np.uint8)

# of all combinations of flags: their bits in the fields of an object
_FLAGS = np.arange(256)
_HOW = (np.where(_FLAGS & _TX, blf.TX, 0) | np.where(_FLAGS & _REMOTE, blf.REMOTE, 0)).astype(np.uint8)
_FD_FLAGS = np.where(_FLAGS & _BRS, blf.FD_BRS, 0) | np.where(_FLAGS & _ESI, blf.FD_ESI, 0)
_FD_FLAGS = (blf.FD_EDL | _FD_FLAGS).astype(np.uint8)


class _Kind(NamedTuple):
    """Objects of one type: their fields in the file, and an object in which everything is set that never changes."""

    dtype: np.dtype[Any]
    blank: npt.NDArray[Any]


def _kind(number: int, body: int, fields: dict[str, tuple[str, int]]) -> _Kind:
    """`fields`: numpy's type and the place behind the object header of each."""
    at = {"stamp": ("<u8", blf.OBJECT_V1_SIZE - 8)}
    at |= {name: (kind, blf.OBJECT_V1_SIZE + place) for name, (kind, place) in fields.items()}
    size = blf.OBJECT_V1_SIZE + body
    dtype = np.dtype(
        {
            "names": list(at),
            "formats": [kind for kind, _ in at.values()],
            "offsets": [place for _, place in at.values()],
            "itemsize": size,
        }
    )
    head = blf.OBJECT.pack(blf.SIGNATURE, blf.OBJECT_V1_SIZE, 1, size, number)
    head += blf.STAMP.pack(blf.ONE_NANOSECOND, 0, 0, 0)
    return _Kind(dtype, np.frombuffer(head.ljust(size, b"\0"), np.uint8))


# the places of `blf_layout.CLASSIC`, `FD` and `ERROR_EXT`
_CLASSIC = _kind(
    blf.CAN_MESSAGE,
    blf.CLASSIC.size,
    {"channel": ("<u2", 0), "how": ("u1", 2), "dlc": ("u1", 3), "id": ("<u4", 4), "data": ("8u1", 8)},
)
_CAN_FD = _kind(
    blf.CAN_FD_MESSAGE,
    blf.FD.size,
    {
        "channel": ("<u2", 0),
        "how": ("u1", 2),
        "dlc": ("u1", 3),
        "id": ("<u4", 4),
        "fd": ("u1", 13),
        "valid": ("u1", 14),
        "data": ("64u1", 20),
    },
)
_ERROR_EXT = _kind(
    blf.CAN_ERROR_EXT,
    blf.ERROR_EXT.size,
    {"channel": ("<u2", 0), "dlc": ("u1", 10), "id": ("<u4", 16), "data": ("8u1", 24)},
)


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
    some_error, some_fd = bool(error.any()), bool(fd.any())
    if not some_error and not some_fd:
        objects = _classic(chunk, stamps)
        size = objects.dtype.itemsize
        return Encoded(objects.view(np.uint8), np.arange(1, len(flags) + 1) * size)
    sizes = np.full(len(flags), _CLASSIC.dtype.itemsize)
    sizes[error] = _ERROR_EXT.dtype.itemsize
    sizes[fd] = _CAN_FD.dtype.itemsize
    ends = np.cumsum(sizes)
    octets = np.empty(int(ends[-1]), np.uint8)
    for kind, wanted, encoded in (
        (_CLASSIC, ~(error | fd), _classic),
        (_CAN_FD, fd, _can_fd),
        (_ERROR_EXT, error, _error),
    ):
        rows = np.flatnonzero(wanted)
        if rows.size:
            size = kind.dtype.itemsize
            part = select(chunk, rows)
            begins = ends[rows] - size
            octets[begins[:, None] + np.arange(size)] = (
                encoded(part, stamps[rows]).view(np.uint8).reshape(-1, size)
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


def _blank(kind: _Kind, chunk: Columns, stamps: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    """Objects with what all kinds have."""
    n = len(stamps)
    objects = np.empty((n, kind.dtype.itemsize), np.uint8)
    objects[:] = kind.blank
    fields = objects.reshape(-1).view(kind.dtype)
    fields["stamp"] = stamps.view(np.uint64)
    fields["channel"] = chunk.bus + 1
    extended = (chunk.flags & _EXTENDED) != 0
    fields["id"] = chunk.id | np.where(extended, np.uint32(blf.ID_EXTENDED), np.uint32(0))
    width = min(chunk.data.shape[1], fields["data"].shape[1])
    fields["data"][:, :width] = chunk.data[:, :width]
    return fields


def _classic(chunk: Columns, stamps: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    objects = _blank(_CLASSIC, chunk, stamps)
    objects["how"] = _HOW[chunk.flags]
    objects["dlc"] = chunk.length
    return objects


def _can_fd(chunk: Columns, stamps: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    flags = chunk.flags
    objects = _blank(_CAN_FD, chunk, stamps)
    objects["how"] = _HOW[flags]
    objects["dlc"] = _DLC[chunk.length]
    objects["fd"] = _FD_FLAGS[flags]
    objects["valid"] = np.where(flags & _REMOTE, np.uint8(0), chunk.length)
    return objects


def _error(chunk: Columns, stamps: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    objects = _blank(_ERROR_EXT, chunk, stamps)
    objects["dlc"] = np.minimum(np.where(chunk.flags & _REMOTE, np.uint8(0), chunk.length), CLASSIC_BYTES)
    return objects
