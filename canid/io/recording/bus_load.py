"""Bus load: the time that a frame takes on its bus."""

from __future__ import annotations

import math

import numpy as np

from canid.values.types import Columns, Flag

# Bits without data, stuffing left out as `canbusload` does: SOF to the interframe space (ISO 11898-1).
_CLASSIC_BITS, _CLASSIC_EXTENDED_BITS = 47, 67
# CAN FD: SOF to BRS, and ACK to the interframe space, at the arbitration rate;
_FD_SLOW_BITS, _FD_SLOW_EXTENDED_BITS = 29, 49
# ESI, DLC, stuff count and CRC with its fixed stuff bits at the data rate, up to and above 16 data bytes.
_FD_FAST_BITS, _FD_FAST_LONG_BITS = 31, 36
_FD_SHORT_BITS = 16 * 8
# An error flag and its delimiter: 6 to 12 bits, then 8, then the interframe space.
_ERROR_BITS = 20
_EXTENDED, _ERROR_FLAG, _FD, _BRS = int(Flag.EXTENDED), int(Flag.ERROR), int(Flag.FD), int(Flag.BRS)
_REMOTE = int(Flag.REMOTE)


def seconds(chunk: Columns, bitrate: float, data_bitrate: float = math.nan) -> float:
    """Time on the bus of all frames together in s; NaN where the bit rate (bit/s) is unknown.

    >>> from canid.values.frame_columns import columns_of
    >>> from canid.values.types import Frame
    >>> round(seconds(columns_of([Frame(0.0, 0, 0x123, bytes(8))] * 2), 500_000) * 1e6)
    444
    """
    if math.isnan(bitrate):
        return math.nan
    flags = chunk.flags
    error, fd, extended = (flags & _ERROR_FLAG) != 0, (flags & _FD) != 0, (flags & _EXTENDED) != 0
    bits = 8 * np.where(flags & _REMOTE, 0, chunk.length.astype(np.int64))
    slow = np.where(extended, _CLASSIC_EXTENDED_BITS, _CLASSIC_BITS) + bits
    slow[fd] = np.where(extended[fd], _FD_SLOW_EXTENDED_BITS, _FD_SLOW_BITS)
    fast = np.where(fd, bits + np.where(bits <= _FD_SHORT_BITS, _FD_FAST_BITS, _FD_FAST_LONG_BITS), 0)
    slow[error], fast[error] = _ERROR_BITS, 0
    # without a rate switch, or with an unknown data rate, all runs at the arbitration rate
    switched = int(fast[(flags & _BRS) != 0].sum()) if not math.isnan(data_bitrate) else 0
    ordinary = int(slow.sum()) + int(fast.sum()) - switched
    return ordinary / bitrate + (switched / data_bitrate if switched else 0.0)
