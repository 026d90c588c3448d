"""The frames of a block of .asc lines, as columns with one row per line."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.frame_columns import CLASSIC_BYTES, FD_BYTES
from canid.logs.blf.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI
from canid.types import Flag

Bytes = npt.NDArray[np.uint8]

_FD, _BRS, _ESI = int(Flag.FD), int(Flag.BRS), int(Flag.ESI)


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


def fd_flags(bits: npt.NDArray[Any], brs: Bytes, esi: Bytes) -> Bytes:
    """Flags of CANFD lines, from the bits of their flags field and their BRS and ESI digits.

    Flags without EDL: a classic frame on a CAN FD channel; all zero: the writer left them out.

    >>> one = np.ones(3, np.uint8)
    >>> fd_flags(np.array([0x1000, 0, 0x10000]), one, 0 * one).tolist() == [_FD | _BRS, _FD | _BRS, 0]
    True
    """
    fd = ((bits & FD64_EDL) != 0) | (bits == 0)
    flags: Bytes = fd * np.uint8(_FD)
    flags |= (fd & ((brs == 1) | ((bits & FD64_BRS) != 0))) * np.uint8(_BRS)
    flags |= (fd & ((esi == 1) | ((bits & FD64_ESI) != 0))) * np.uint8(_ESI)
    return flags
