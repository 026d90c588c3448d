"""python-can's Message to a Frame and back."""

from __future__ import annotations

from typing import Any

from canid import timestamps
from canid.buses import python_can
from canid.types import Flag, Frame

# plain ints: `|` of two Flags takes ten times as long
_EXTENDED, _REMOTE, _ERROR, _FD = int(Flag.EXTENDED), int(Flag.REMOTE), int(Flag.ERROR), int(Flag.FD)
_BRS, _ESI, _TX = int(Flag.BRS), int(Flag.ESI), int(Flag.TX)


def flags_of(message: Any) -> int:
    """Collect the `Flag`s of a python-can Message.

    >>> flags_of(python_can.load().Message(is_extended_id=True, is_rx=False))
    65
    """
    flags = _EXTENDED if message.is_extended_id else 0
    if message.is_fd:
        flags |= _FD
    if message.bitrate_switch:
        flags |= _BRS
    if message.error_state_indicator:
        flags |= _ESI
    if message.is_remote_frame:
        flags |= _REMOTE
    if message.is_error_frame:
        flags |= _ERROR
    return flags if message.is_rx else flags | _TX


def frame_of(message: Any, bus: int, first_ns: int = 0) -> Frame:
    """Make a Frame of a Message, its time relative to `first_ns`.

    >>> frame_of(python_can.load().Message(1.5, 7, is_extended_id=False, data=b"a"), 0)
    Frame(t=1.5, bus=0, id=7, data=b'a', flags=0, length=-1)
    """
    length = message.dlc if message.is_remote_frame else -1
    t = (timestamps.from_float(message.timestamp) - first_ns) * 1e-9
    return Frame(t, bus, message.arbitration_id, bytes(message.data), flags_of(message), length)


def message_of(frame: Frame, start_utc: float = 0.0) -> Any:
    """Make a Message of a Frame; its channel is the bus number.

    >>> message_of(Frame(0.5, 1, 0x123, b"ab")).dlc
    2
    """
    flags = frame.flags
    remote = bool(flags & Flag.REMOTE)
    return python_can.load().Message(
        timestamp=start_utc + frame.t,
        arbitration_id=frame.id,
        is_extended_id=bool(flags & Flag.EXTENDED),
        is_remote_frame=remote,
        is_error_frame=bool(flags & Flag.ERROR),
        is_fd=bool(flags & Flag.FD),
        bitrate_switch=bool(flags & Flag.BRS),
        error_state_indicator=bool(flags & Flag.ESI),
        is_rx=not flags & Flag.TX,
        channel=frame.bus,
        dlc=max(frame.length, 0) if remote else len(frame.data),
        data=None if remote else frame.data,
    )
