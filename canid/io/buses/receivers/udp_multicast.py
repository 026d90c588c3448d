"""Receiving python-can's udp_multicast frames from their socket: whole ns of the kernel, a third of the CPU time.

python-can opens and configures the socket; its own receive loop makes one more system call per frame, and a
validated Message. The datagrams are its own: a msgpack map with the fields of `can.Message` (python-can 4.6,
`interfaces/udp_multicast/utils.py`).
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from typing import Any, NoReturn

from canid.io.buses.frame_check import ImpossibleFrameError
from canid.io.buses.receivers.received_frame import Received
from canid.io.buses.receivers.socketcan import timespec_ns
from canid.io.buses.socket_wait import SocketWait
from canid.io.buses.timestamp_source import TimestampSource
from canid.values.errors import BusError
from canid.values.types import Flag

# bytes: a CAN FD frame with all its field names has 250
MAX_DATAGRAM_BYTES = 4096
_STAMPS = (35, 64)  # SO_TIMESTAMPNS, old and new (asm-generic/socket.h)
ANCILLARY_BYTES = socket.CMSG_SPACE(16)
_FLAG_FIELDS = (
    ("is_remote_frame", int(Flag.REMOTE)),
    ("is_error_frame", int(Flag.ERROR)),
    ("is_fd", int(Flag.FD)),
    ("bitrate_switch", int(Flag.BRS)),
    ("error_state_indicator", int(Flag.ESI)),
)
_EXTENDED, _REMOTE = int(Flag.EXTENDED), int(Flag.REMOTE)


def parse(fields: Any, ns: int) -> Received:
    """A frame from the fields of a datagram, with the defaults of `can.Message`; `frame_check` validates the values.

    Raises ImpossibleFrameError where they are none.

    >>> parse({"arbitration_id": 0x123, "data": b"ab", "dlc": 2, "is_fd": True, "is_extended_id": False}, 5)
    Received(ns=5, id=291, data=b'ab', flags=8, length=-1)
    """
    if type(fields) is not dict or "arbitration_id" not in fields:
        raise ImpossibleFrameError("a datagram that is no frame", ns)
    get = fields.get
    # as can.Message: an id is extended unless stated otherwise
    flags = _EXTENDED if _switch(get("is_extended_id", True), ns) else 0
    for name, flag in _FLAG_FIELDS:
        value = get(name)
        if value and _switch(value, ns):
            flags |= flag
    data, dlc = get("data"), get("dlc")
    if data is None:
        data = b""
    if type(data) is not bytes or (dlc is not None and type(dlc) is not int):
        raise ImpossibleFrameError("data or a DLC of the wrong type", ns)
    if flags & _REMOTE:
        return Received(ns, fields["arbitration_id"], data, flags, dlc or 0)
    if dlc is not None and dlc != len(data):
        raise ImpossibleFrameError("a DLC that contradicts the data", ns)
    return Received(ns, fields["arbitration_id"], data, flags)


def _switch(value: Any, ns: int) -> bool:
    if value is True or value is False or value is None:
        return bool(value)
    if type(value) is int and value in (0, 1):
        return value == 1
    raise ImpossibleFrameError("a flag that is neither true nor false", ns)


class UdpReceiver:
    """Receives from the socket of python-can's UdpMulticastBus; filters and hiding FD frames are up to the caller."""

    def __init__(self, bus: Any, name: str, count: Callable[[], int]):
        """`count` returns the number of frames that the kernel has dropped."""
        import msgpack

        self._unpack = msgpack.unpackb
        self._close = bus.shutdown
        self._socket = socket.socket(fileno=os.dup(bus.fileno()))
        self._name = name
        self._count = count
        self.clock = TimestampSource.KERNEL
        self._wait = SocketWait(self._socket)

    @property
    def drops(self) -> int:
        """Frames that the kernel has dropped."""
        return self._count()

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s; raises BusError where the socket fails, ImpossibleFrameError for no frame."""
        return self._wait.receive(timeout, self._read, lost=self._is_lost)

    def _read(self) -> Received:
        data, ancillary, _, _ = self._socket.recvmsg(MAX_DATAGRAM_BYTES, ANCILLARY_BYTES, socket.MSG_DONTWAIT)
        ns = 0
        for level, kind, value in ancillary:
            if level == socket.SOL_SOCKET and kind in _STAMPS:
                ns = timespec_ns(value)
        if not ns:
            self.clock, ns = TimestampSource.HOST, time.time_ns()
        try:
            fields = self._unpack(data)
        except Exception:  # msgpack's own kinds, and what its unpacker raises besides
            raise ImpossibleFrameError("a datagram that is no frame", ns) from None
        return parse(fields, ns)

    def _is_lost(self, error: OSError | ValueError) -> NoReturn:
        raise BusError(f"{self._name} is lost: {getattr(error, 'strerror', None) or error}") from None

    def controller(self) -> str:
        """Nothing: there is none."""
        return ""

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        self._close()
