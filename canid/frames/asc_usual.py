"""What is read of a block's usual lines at once, by shapes (`asc_shapes`) or by words (`asc_words`)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.frames.blf_layout import FD64_BRS, FD64_EDL, FD64_ESI
from canid.frames.columns import CLASSIC_BYTES, FD_BYTES
from canid.types import Flag

Bytes = npt.NDArray[np.uint8]

_FD, _BRS, _ESI = int(Flag.FD), int(Flag.BRS), int(Flag.ESI)


class Usual(NamedTuple):
    """A block's lines; where not `found`, the other columns mean nothing."""

    found: npt.NDArray[np.bool_]  # (n,) it is a frame, and read
    ns: npt.NDArray[np.int64]  # (n,) its time as it stands there
    bus: npt.NDArray[np.uint16]
    id: npt.NDArray[np.uint32]
    flags: Bytes
    length: Bytes
    data: Bytes  # (n, 8) or (n, 64)


def nothing(n: int, width: int = CLASSIC_BYTES) -> Usual:
    """`n` lines of which none is read.

    >>> bool(nothing(3).found.any()), nothing(3).data.shape
    (False, (3, 8))
    """
    return Usual(
        np.zeros(n, bool), np.zeros(n, np.int64), np.zeros(n, np.uint16), np.zeros(n, np.uint32),
        np.zeros(n, np.uint8), np.zeros(n, np.uint8), np.zeros((n, width), np.uint8),
    )  # fmt: skip


def wide_enough(usual: Usual, longest: int) -> Usual:
    """The same lines, with room for `longest` bytes of data.

    >>> wide_enough(nothing(3), 12).data.shape
    (3, 64)
    """
    if longest <= usual.data.shape[1]:
        return usual
    wider = np.zeros((len(usual.data), FD_BYTES), np.uint8)
    wider[:, : usual.data.shape[1]] = usual.data
    return usual._replace(data=wider)


def fd_flags(bits: npt.NDArray[Any], brs: Bytes, esi: Bytes) -> Bytes:
    """Flags of CANFD lines, out of their own flags' bits and their digits for BRS and ESI.

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
