"""Receiving python-can's udp_multicast frames from their socket: whole ns of the kernel, a third of the CPU time.

python-can opens and configures the socket; its own receive loop makes a system call more per frame, and a Message
that is checked. The datagrams are its own: a msgpack map with the fields of `can.Message` (python-can 4.6,
`interfaces/udp_multicast/utils.py`).
"""

from __future__ import annotations

import os
import select
import socket
import time
from collections.abc import Callable
from typing import Any

from canid.errors import BusError
from canid.frames.received import Received
from canid.frames.socketcan import NAP, timespec_ns
from canid.frames.stamp_clock import StampClock
from canid.types import Flag

# bytes: a CAN FD frame with all its field names has 250
_DATAGRAM = 4096
_STAMPS = (35, 64)  # SO_TIMESTAMPNS, old and new (asm-generic/socket.h)
_ANCILLARY = socket.CMSG_SPACE(16)
_FLAGS = {
    "is_extended_id": int(Flag.EXTENDED),
    "is_remote_frame": int(Flag.REMOTE),
    "is_error_frame": int(Flag.ERROR),
    "is_fd": int(Flag.FD),
    "bitrate_switch": int(Flag.BRS),
    "error_state_indicator": int(Flag.ESI),
}


def parse(fields: Any, ns: int) -> Received | None:
    """A frame from the fields of a datagram; None where they are none.

    >>> parse({"arbitration_id": 0x123, "data": b"ab", "dlc": 2, "is_fd": True}, 5)
    Received(ns=5, id=291, data=b'ab', flags=8, length=-1)
    """
    try:
        id_, data = fields["arbitration_id"], fields["data"] or b""
        flags = 0
        for name, flag in _FLAGS.items():
            if fields.get(name):
                flags |= flag
        length = int(fields["dlc"]) if flags & _FLAGS["is_remote_frame"] else -1
    except (TypeError, KeyError, AttributeError):
        return None
    if not isinstance(id_, int) or not isinstance(data, bytes):
        return None
    return Received(ns, id_, data, flags, length)


class UdpReceiver:
    """Receives from the socket of python-can's UdpMulticastBus, which must have no filters."""

    def __init__(self, bus: Any, name: str, count: Callable[[], int]):
        """`count`: of the frames that the kernel has dropped."""
        import msgpack

        self._unpack = msgpack.unpackb
        self._nonsense: tuple[type[Exception], ...] = (ValueError, msgpack.exceptions.UnpackException)
        self._close = bus.shutdown
        self._socket = socket.socket(fileno=os.dup(bus.fileno()))
        self._name = name
        self._count = count
        self._fd = "FD" in str(bus.protocol)
        self.clock = StampClock.KERNEL
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)

    @property
    def drops(self) -> int:
        """Frames that the kernel has dropped."""
        return self._count()

    def recv(self, timeout: float) -> Received | None:
        """Wait up to `timeout` s; raises BusError where the socket fails."""
        end = time.monotonic() + timeout
        while True:
            try:
                data, ancillary, _, _ = self._socket.recvmsg(_DATAGRAM, _ANCILLARY, socket.MSG_DONTWAIT)
            except (BlockingIOError, InterruptedError):
                left = end - time.monotonic()
                if left <= 0:
                    return None
                if self._poll.poll(left * 1000):
                    time.sleep(NAP)
                continue
            except OSError as error:
                raise BusError(f"{self._name} is lost: {error.strerror or error}") from None
            ns = 0
            for level, kind, value in ancillary:
                if level == socket.SOL_SOCKET and kind in _STAMPS:
                    ns = timespec_ns(value)
            if not ns:
                self.clock, ns = StampClock.HOST, time.time_ns()
            try:
                got = parse(self._unpack(data), ns)
            except self._nonsense:
                continue  # somebody else's datagram
            if got is not None and (self._fd or not got.flags & _FLAGS["is_fd"]):
                return got

    def controller(self) -> str:
        """Nothing: there is none."""
        return ""

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        self._close()
