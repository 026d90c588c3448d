"""Bus load: the time that a frame takes on its bus."""

from __future__ import annotations

import math

from canid.types import Flag, Frame

# Bits without data, stuffing left out as `canbusload` does: SOF to the interframe space (ISO 11898-1).
_CLASSIC_BITS, _CLASSIC_EXTENDED_BITS = 47, 67
# CAN FD: SOF to BRS, and ACK to the interframe space, at the arbitration rate;
_FD_SLOW_BITS, _FD_SLOW_EXTENDED_BITS = 29, 49
# ESI, DLC, stuff count and CRC with its fixed stuff bits at the data rate, up to and above 16 data bytes.
_FD_FAST_BITS, _FD_FAST_LONG_BITS = 31, 36
# An error flag and its delimiter: 6 to 12 bits, then 8, then the interframe space.
_ERROR_BITS = 20
_EXTENDED, _ERROR_FLAG, _FD, _BRS = int(Flag.EXTENDED), int(Flag.ERROR), int(Flag.FD), int(Flag.BRS)


def seconds(frame: Frame, bitrate: float, data_bitrate: float = math.nan) -> float:
    """Time on the bus in s; NaN where the bit rate (bit/s) is unknown.

    >>> round(seconds(Frame(0.0, 0, 0x123, bytes(8)), 500_000) * 1e6)
    222
    """
    flags = frame.flags
    if flags & _ERROR_FLAG:
        return _ERROR_BITS / bitrate
    bits = 8 * len(frame.data)
    if not flags & _FD:
        return ((_CLASSIC_EXTENDED_BITS if flags & _EXTENDED else _CLASSIC_BITS) + bits) / bitrate
    slow = _FD_SLOW_EXTENDED_BITS if flags & _EXTENDED else _FD_SLOW_BITS
    fast = bits + (_FD_FAST_BITS if len(frame.data) <= 16 else _FD_FAST_LONG_BITS)
    # without a rate switch, or with an unknown data rate, all runs at the arbitration rate
    quick = data_bitrate if flags & _BRS and not math.isnan(data_bitrate) else bitrate
    return slow / bitrate + fast / quick
