"""The frames of a block of lines, as columns with one row per line: parsed as arrays, and one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.frame_columns import CLASSIC_BYTES, FD_BYTES
from canid.values.types import Flag

Bytes = npt.NDArray[np.uint8]

_REMOTE = int(Flag.REMOTE)
# bus, id, data, flags, and the bytes that a remote frame asks for
Single = tuple[int, int, bytes, int, int]


class LineColumns(NamedTuple):
    """A block's lines; in rows that are not `found` the other columns are undefined."""

    found: npt.NDArray[np.bool_]  # (n,) the line is a frame, and parsed
    ns: npt.NDArray[np.int64]  # (n,) time as written in the line
    bus: npt.NDArray[np.uint16]
    id: npt.NDArray[np.uint32]
    flags: Bytes
    length: Bytes
    data: Bytes  # (n, 8) or (n, 64)


def none_found(n: int, width: int = CLASSIC_BYTES) -> LineColumns:
    """`n` lines of which none is parsed.

    >>> bool(none_found(3).found.any()), none_found(3).data.shape
    (False, (3, 8))
    """
    return LineColumns(
        np.zeros(n, bool), np.zeros(n, np.int64), np.zeros(n, np.uint16), np.zeros(n, np.uint32),
        np.zeros(n, np.uint8), np.zeros(n, np.uint8), np.zeros((n, width), np.uint8),
    )  # fmt: skip


def widened(fixed: LineColumns, longest: int) -> LineColumns:
    """The same lines, with data columns wide enough for `longest` bytes.

    >>> widened(none_found(3), 12).data.shape
    (3, 64)
    """
    if longest <= fixed.data.shape[1]:
        return fixed
    wider = np.zeros((len(fixed.data), FD_BYTES), np.uint8)
    wider[:, : fixed.data.shape[1]] = fixed.data
    return fixed._replace(data=wider)


def merged(fixed: LineColumns, singles: Sequence[tuple[int, Single]]) -> LineColumns:
    """Insert frames that were parsed one by one, each with its row; their times are the caller's.

    >>> whole = merged(none_found(3), [(1, (0, 0x123, b"ab", 0, -1))])
    >>> whole.found.tolist(), whole.id.tolist(), whole.length.tolist()
    ([False, True, False], [0, 291, 0], [0, 2, 0])
    """
    if not singles:
        return fixed
    at = np.array([k for k, _ in singles])
    bus, id_, data, flags, asked = zip(*(frame for _, frame in singles), strict=True)
    lengths = np.array([len(each) for each in data])
    fixed = widened(fixed, int(lengths.max()))
    fixed.found[at] = True
    fixed.bus[at], fixed.id[at], fixed.flags[at] = bus, id_, flags
    fixed.length[at] = np.where(fixed.flags[at] & _REMOTE, np.maximum(asked, 0), lengths)
    width = fixed.data.shape[1]
    octets = b"".join([each.ljust(width, b"\0") for each in data])
    fixed.data[at] = np.frombuffer(octets, np.uint8).reshape(-1, width)
    return fixed
