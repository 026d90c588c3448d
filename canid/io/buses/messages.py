"""python-can's Message to a Frame and back."""

from __future__ import annotations

import operator
from typing import Any

from canid.io.buses import python_can
from canid.io.buses.frame_check import ImpossibleFrameError
from canid.io.buses.receivers.received_frame import Received
from canid.values import timestamps
from canid.values.frame_columns import MAX_EXTENDED_ID
from canid.values.types import Flag, Frame

# plain ints: `|` of two Flags takes ten times as long
_EXTENDED, _REMOTE, _ERROR, _FD = int(Flag.EXTENDED), int(Flag.REMOTE), int(Flag.ERROR), int(Flag.FD)
_BRS, _ESI, _TX = int(Flag.BRS), int(Flag.ESI), int(Flag.TX)
_KEPT_OF_ERRORS = _ERROR | _EXTENDED | _TX
_MAX_DATA_BYTES = 64


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


def received_of(message: Any, now_ns: int) -> Received:
    """Make a received frame of a Message, whatever a back end has put into its fields.

    Args:
        message: of python-can.
        now_ns: the host's clock, ns since 1970: for an interface that gives no time stamp it is the next best.

    Raises:
        ImpossibleFrameError: it is no frame. Other exceptions where a field has another type.

    >>> received_of(python_can.load().Message(0.0, 7, is_extended_id=False, data=b"a"), 10**18)
    Received(ns=1000000000000000000, id=7, data=b'a', flags=0, length=-1)
    """
    data = message.data
    if not isinstance(data, bytes | bytearray | memoryview):
        raise ImpossibleFrameError(f"data of type {type(data).__name__}")
    if len(data) > _MAX_DATA_BYTES:
        raise ImpossibleFrameError(f"{len(data)} data bytes")
    stamp = message.timestamp
    ns = timestamps.from_float(float(stamp)) if stamp else now_ns
    dlc, id_ = operator.index(message.dlc), operator.index(message.arbitration_id)
    flags = flags_of(message)
    if flags & _ERROR:
        # of an error frame these fields hold whatever the driver left there
        return Received(ns, id_ & MAX_EXTENDED_ID, bytes(data[:8]), flags & _KEPT_OF_ERRORS)
    if flags & _REMOTE:
        return Received(ns, id_, bytes(data), flags, dlc)
    # some back ends return eight bytes whatever the DLC; a classic frame's raw DLC may be 9 to 15
    if dlc > len(data) and not (len(data) == 8 and dlc <= 15 and not flags & _FD):
        raise ImpossibleFrameError("fewer data bytes than its DLC announces")
    return Received(ns, id_, bytes(data[:dlc]), flags)


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
